//! What goes by age, and what never does.
use std::collections::HashSet;

use uuid::Uuid;

use super::super::{
    ArtifactId, Before, Expired, JobId, JobState, Lease, Ledger, NewArtifact, NewAsset, NewJob, Origin,
};
use super::Factory;
use super::fixture::*;
use super::outputs::make_key;
use super::registry::{new_asset, owner_and_key, register};

const ALL: u32 = 1000;

/// The same time for everything.
fn before(time: i64) -> Before {
    Before {
        uploads: Some(time),
        outputs: Some(time),
        jobs: Some(time),
    }
}

/// Deletes what is marked, as housekeeping does, until there is no more.
async fn collect(ledger: &dyn Ledger) {
    loop {
        let marked = ledger.abandoned_artifacts(0, ALL).await.unwrap();
        if marked.is_empty() {
            return;
        }
        for artifact in marked {
            ledger.forget_artifact(artifact.id).await.unwrap();
        }
    }
}

/// Expires until there is nothing more to.
async fn expire(ledger: &dyn Ledger, before: Before) -> Expired {
    let mut all = Expired::default();
    loop {
        collect(ledger).await;
        let expired = ledger.expire(before, ALL).await.unwrap();
        if expired == Expired::default() {
            return all;
        }
        all.artifacts += expired.artifacts;
        all.jobs += expired.jobs;
    }
}

async fn reading(ledger: &dyn Ledger, inputs: &[ArtifactId], now: i64) -> JobId {
    let new = NewJob {
        inputs: inputs.to_vec(),
        ..new_job()
    };
    ledger.create_job(new, now).await.unwrap().id
}

async fn evidence(ledger: &dyn Ledger, lease: &Lease, now: i64) -> ArtifactId {
    let origin = Origin::Output {
        job: lease.job.id,
        token: lease.token.clone(),
    };
    let new = NewArtifact {
        evidence: true,
        ..new_artifact(origin, false)
    };
    let id = ledger.create_artifact(new, now).await.unwrap().id;
    ledger.artifact_ready(id, Some(&lease.token), now).await.unwrap();
    id
}

/// A job that ended at a time, and what it made.
async fn ended(ledger: &dyn Ledger, inputs: &[ArtifactId], now: i64) -> (JobId, ArtifactId) {
    let id = reading(ledger, inputs, now).await;
    let lease = claim_of(ledger, id, now).await;
    let made = output(ledger, &lease, false, now).await;
    complete(ledger, &lease, &[made], now).await;
    (id, made)
}

async fn has_job(ledger: &dyn Ledger, id: JobId) -> bool {
    ledger.get_job(id).await.unwrap().is_some()
}

pub(crate) async fn nothing_goes_by_itself(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let scene = upload(&*ledger, at(0)).await;
    let (job, made) = ended(&*ledger, &[scene], at(1)).await;
    assert_eq!(expire(&*ledger, Before::default()).await, Expired::default());
    assert_eq!(expire(&*ledger, before(at(0))).await, Expired::default(), "not older");
    assert!(visible(&*ledger, scene).await && visible(&*ledger, made).await && has_job(&*ledger, job).await);
}

pub(crate) async fn uploads_go_when_they_were_not_used_for_long(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let [unused, used, needed, original] = [0; 4].map(|_| Uuid::nil());
    let mut uploads = [unused, used, needed, original];
    for id in &mut uploads {
        *id = upload(&*ledger, at(0)).await;
    }
    let [unused, used, needed, original] = uploads;
    let (_, made) = ended(&*ledger, &[used], at(50)).await;
    let (owner, key) = owner_and_key(&*ledger).await;
    let new = NewAsset {
        artifact: Some(original),
        ..new_asset(owner, key)
    };
    register(&*ledger, new, at(1)).await;
    let waiting = reading(&*ledger, &[needed], at(1)).await;
    let uploads = |time| Before {
        uploads: Some(time),
        ..Before::default()
    };
    let one = Expired { artifacts: 1, jobs: 0 };
    assert_eq!(expire(&*ledger, uploads(at(50))).await, one);
    assert!(!visible(&*ledger, unused).await);
    assert_eq!(ledger.get_any_artifact(unused).await.unwrap(), None);
    assert_eq!(expire(&*ledger, uploads(at(51))).await, one);
    assert!(!visible(&*ledger, used).await && visible(&*ledger, made).await);
    ledger.cancel_job(waiting, at(60)).await.unwrap();
    assert_eq!(expire(&*ledger, uploads(at(60))).await, Expired::default());
    assert_eq!(expire(&*ledger, uploads(at(61))).await, one);
    assert!(!visible(&*ledger, needed).await && visible(&*ledger, original).await);
}

pub(crate) async fn jobs_go_with_what_they_made(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (gone, made) = ended(&*ledger, &[], at(10)).await;
    let (keeps, read) = ended(&*ledger, &[], at(11)).await;
    let reader = reading(&*ledger, &[read], at(12)).await;
    let (of_key, key) = make_key_after(&*ledger, reader, at(13)).await;
    let id = queue(&*ledger, at(14)).await;
    let lease = claim_of(&*ledger, id, at(14)).await;
    let report = evidence(&*ledger, &lease, at(14)).await;
    let beside = output(&*ledger, &lease, false, at(14)).await;
    complete(&*ledger, &lease, &[report, beside], at(14)).await;

    let jobs = |time| Before {
        jobs: Some(time),
        ..Before::default()
    };
    assert_eq!(expire(&*ledger, jobs(at(10))).await, Expired::default());
    let went = expire(&*ledger, jobs(at(1000))).await;
    assert_eq!(went, Expired { artifacts: 1, jobs: 1 });
    assert!(!has_job(&*ledger, gone).await && !visible(&*ledger, made).await);
    assert!(
        has_job(&*ledger, keeps).await && visible(&*ledger, read).await,
        "read by a job that waits"
    );
    assert!(has_job(&*ledger, of_key).await);
    assert!(ledger.get_key(key).await.unwrap().is_some());
    assert!(has_job(&*ledger, id).await && visible(&*ledger, report).await && visible(&*ledger, beside).await);
    // Outputs may go before their jobs do; evidence stays then, too.
    let outputs = Before {
        outputs: Some(at(1000)),
        ..Before::default()
    };
    assert_eq!(expire(&*ledger, outputs).await, Expired { artifacts: 1, jobs: 0 });
    assert!(visible(&*ledger, report).await && !visible(&*ledger, beside).await && has_job(&*ledger, id).await);
    // Without its evidence, which somebody deleted, it is a job like others.
    ledger.delete_artifact(report, at(1001)).await.unwrap();
    assert_eq!(
        expire(&*ledger, jobs(at(1000))).await,
        Expired { artifacts: 0, jobs: 1 }
    );
}

/// Makes a key while another job waits, which is claimed and given back.
async fn make_key_after(ledger: &dyn Ledger, waiting: JobId, now: i64) -> (JobId, Uuid) {
    let lease = claim_of(ledger, waiting, now).await;
    let (job, key) = make_key(ledger, now).await;
    ledger.release(waiting, &lease.token, now).await.unwrap();
    // So that it is out of the way of others, and still running.
    claim_of(ledger, waiting, now).await;
    (job, key.id)
}

pub(crate) async fn paths_are_known_while_there_are_rows(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = upload(&*ledger, at(0)).await;
    let path = ledger.get_any_artifact(id).await.unwrap().unwrap().path;
    let known = async || ledger.known_paths(&[Uuid::now_v7(), id]).await.unwrap();
    assert_eq!(known().await, HashSet::from([path.clone()]));
    ledger.delete_artifact(id, at(1)).await.unwrap();
    assert_eq!(known().await, HashSet::from([path]), "its bytes may still be there");
    ledger.forget_artifact(id).await.unwrap();
    assert_eq!(known().await, HashSet::new());
    assert_eq!(ledger.known_paths(&[]).await.unwrap(), HashSet::new());
}

/// Small numbers that look like chance, the same in every run.
struct Dice(u64);

impl Dice {
    fn roll(&mut self, sides: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % sides
    }

    /// Some of them, or none.
    fn pick<T: Copy>(&mut self, all: &[T]) -> Vec<T> {
        let most = all.len().min(3);
        (0..self.roll(most + 1)).map(|_| all[self.roll(all.len())]).collect()
    }
}

/// What a test of chance remembers.
#[derive(Default)]
struct World {
    uploads: Vec<(ArtifactId, i64)>,
    jobs: Vec<(JobId, Vec<ArtifactId>)>,
    running: Vec<Lease>,
    /// What came out, with the job, and whether it is evidence.
    outputs: Vec<(ArtifactId, JobId, bool)>,
    originals: Vec<ArtifactId>,
}

/// Random work, and in between things go by random ages: what is referenced, or not that old, is there every time.
pub(crate) async fn nothing_referenced_goes_by_age(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (owner, key) = owner_and_key(&*ledger).await;
    let key_file = ledger.get_key(key).await.unwrap().unwrap().artifact;
    let (mut dice, mut world, mut went) = (Dice(7), World::default(), Expired::default());
    for now in (1..160).map(at) {
        step(&*ledger, &mut dice, &mut world, (owner, key), now).await;
        if dice.roll(4) > 0 {
            continue;
        }
        let mut age = || (dice.roll(3) > 0).then(|| now - (dice.roll(40) as i64) * 1_000_000);
        let before = Before {
            uploads: age(),
            outputs: age(),
            jobs: age(),
        };
        let expired = ledger.expire(before, 1 + dice.roll(5) as u32).await.unwrap();
        if dice.roll(2) == 0 {
            collect(&*ledger).await;
        }
        went.artifacts += expired.artifacts;
        went.jobs += expired.jobs;
        check(&*ledger, &mut world, before).await;
        assert!(ledger.get_any_artifact(key_file).await.unwrap().is_some());
        assert!(ledger.get_key(key).await.unwrap().is_some());
    }
    assert!(went.artifacts > 10 && went.jobs > 5, "{went:?}");
}

async fn step(ledger: &dyn Ledger, dice: &mut Dice, world: &mut World, (owner, key): (Uuid, Uuid), now: i64) {
    let there: Vec<_> = world
        .uploads
        .iter()
        .map(|(id, _)| *id)
        .chain(world.outputs.iter().map(|o| o.0))
        .collect();
    match dice.roll(8) {
        0 | 1 => world.uploads.push((upload(ledger, now).await, now)),
        2 | 3 => {
            let inputs = dice.pick(&there);
            world.jobs.push((reading(ledger, &inputs, now).await, inputs));
        }
        4 => world.running.extend(claim(ledger, now).await),
        5 | 6 if !world.running.is_empty() => {
            let lease = world.running.swap_remove(dice.roll(world.running.len()));
            let made = output(ledger, &lease, false, now).await;
            let mut outputs = vec![made];
            if dice.roll(4) == 0 {
                outputs.push(evidence(ledger, &lease, now).await);
            }
            complete(ledger, &lease, &outputs, now).await;
            world
                .outputs
                .extend(outputs.iter().map(|id| (*id, lease.job.id, *id != made)));
        }
        7 if !there.is_empty() && dice.roll(3) == 0 => {
            let original = there[dice.roll(there.len())];
            let new = NewAsset {
                artifact: Some(original),
                ..new_asset(owner, key)
            };
            register(ledger, new, now).await;
            world.originals.push(original);
        }
        _ => {}
    }
}

/// Looks whether all is there that must be, and forgets what went.
async fn check(ledger: &dyn Ledger, world: &mut World, before: Before) {
    let old =
        |time: Option<i64>, before: Option<i64>| before.is_some_and(|before| time.is_some_and(|time| time < before));
    let mut jobs = Vec::new();
    let mut read = Vec::new();
    for (id, inputs) in &world.jobs {
        let row = ledger.get_job(*id).await.unwrap();
        let left_evidence = world.outputs.iter().any(|(_, job, evidence)| job == id && *evidence);
        let Some(row) = row else {
            assert!(!left_evidence, "a job with evidence went");
            continue;
        };
        if matches!(row.state, JobState::Queued | JobState::Running) {
            for input in inputs {
                assert!(visible(ledger, *input).await, "an input of a job that is not over went");
            }
        }
        read.extend(inputs.iter().map(|input| (*input, row.end_time)));
        jobs.push((*id, row.end_time));
    }
    for original in &world.originals {
        assert!(visible(ledger, *original).await, "the original of an asset went");
    }
    let still_used =
        |id: ArtifactId, before: Option<i64>| read.iter().any(|(input, end)| *input == id && !old(*end, before));
    let mut uploads = Vec::new();
    for (id, time) in world.uploads.drain(..) {
        if visible(ledger, id).await {
            uploads.push((id, time));
        } else {
            assert!(old(Some(time), before.uploads), "a young upload went");
            assert!(!still_used(id, before.uploads), "an upload went that was just used");
        }
    }
    let mut outputs = Vec::new();
    for (id, job, evidence) in world.outputs.drain(..) {
        if visible(ledger, id).await {
            outputs.push((id, job, evidence));
            continue;
        }
        assert!(!evidence, "evidence went");
        let end = jobs.iter().find(|(of, _)| *of == job).map(|(_, end)| *end);
        // A job that is gone was old enough, which its outputs then were, too.
        let old_enough = end.is_none_or(|end| old(end, before.outputs) || old(end, before.jobs));
        assert!(old_enough, "a young output went");
    }
    (world.uploads, world.outputs) = (uploads, outputs);
    world.jobs.retain(|(id, _)| jobs.iter().any(|(there, _)| there == id));
}
