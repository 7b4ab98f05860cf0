//! Which jobs go to which workers: what these say of themselves when they ask for one, and what they can hold.
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use guardsplat_proto::v1::Job;

use crate::error::{Error, Result};
use crate::ledger::{JobRow, JobState, ResourceRequirements, SeenWorker, WorkerCapabilities};
use crate::service::claims::Disclosure;
use crate::service::{Service, clock, text, to_proto};

/// A worker that was not heard of for so long, and has no job, counts for nothing.
const LATELY: Duration = Duration::from_secs(120);
/// A worker that is there is noted so often; they ask for jobs at least twice a minute.
const NOTE_EVERY: Duration = Duration::from_secs(20);
/// How long what is known of workers is good for.
const FRESH: Duration = Duration::from_secs(1);
/// Most CLIPs that a worker may name.
const MAX_CLIPS: usize = 64;
const GIB: f64 = (1_u64 << 30) as f64;

/// From when on a worker was seen that is there now.
pub fn seen_since(now: i64) -> i64 {
    now.saturating_sub(clock::micros(LATELY))
}

/// What this server knows of workers.
#[derive(Default)]
pub struct Placement {
    /// When each was last noted in the ledger, and as what.
    noted: Mutex<HashMap<String, (Instant, SeenWorker)>>,
    /// Those of all servers, as the ledger had them.
    seen: Mutex<Option<(Instant, Arc<[SeenWorker]>)>>,
}

impl Placement {
    /// Whether a worker is to be noted again; from then on it counts as noted.
    fn due(&self, worker: &SeenWorker, now: Instant) -> bool {
        let mut noted = self.noted.lock().unwrap_or_else(PoisonError::into_inner);
        noted.retain(|_, (last, _)| now.duration_since(*last) < LATELY);
        if let Some((last, known)) = noted.get(&worker.name)
            && known == worker
            && now.duration_since(*last) < NOTE_EVERY
        {
            return false;
        }
        noted.insert(worker.name.clone(), (now, worker.clone()));
        true
    }

    fn known(&self, now: Instant) -> Option<Arc<[SeenWorker]>> {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = seen.as_ref().filter(|(read, _)| now.duration_since(*read) < FRESH);
        fresh.map(|(_, workers)| workers.clone())
    }

    fn keep(&self, seen: Option<(Instant, Arc<[SeenWorker]>)>) {
        *self.seen.lock().unwrap_or_else(PoisonError::into_inner) = seen;
    }
}

impl Service {
    /// Notes a worker that asks for a job.
    pub(crate) async fn worker_is_there(&self, worker: &SeenWorker) -> Result<()> {
        if self.placement().due(worker, Instant::now()) {
            self.ledger().note_worker(worker.clone(), clock::now()).await?;
            self.placement().keep(None);
        }
        Ok(())
    }

    /// Workers of all servers that were there lately.
    async fn workers_lately(&self) -> Result<Arc<[SeenWorker]>> {
        let now = Instant::now();
        if let Some(known) = self.placement().known(now) {
            return Ok(known);
        }
        let since = seen_since(clock::now());
        let seen: Arc<[SeenWorker]> = self.ledger().workers_since(since).await?.into();
        self.placement().keep(Some((now, seen.clone())));
        Ok(seen)
    }

    /// Which jobs a worker may be given.
    pub(crate) async fn capabilities(&self, worker: &SeenWorker) -> Result<WorkerCapabilities> {
        let seen = match worker.memory {
            Some(_) => self.workers_lately().await?,
            None => Arc::default(),
        };
        Ok(capabilities(worker, &seen))
    }

    /// A job as somebody is told of it; of one that is queued it is told if nobody can have it.
    pub(crate) async fn describe_job(&self, row: JobRow, disclosure: Disclosure) -> Result<Job> {
        let waiting_reason = match row.state {
            JobState::Queued => waiting_reason(&row.requirements, &self.workers_lately().await?),
            _ => None,
        };
        Ok(Job {
            waiting_reason: waiting_reason.unwrap_or_default(),
            ..disclosure.job(to_proto::job(row))
        })
    }
}

/// What a worker says of itself.
pub(crate) fn described(
    worker: String,
    device: String,
    version: String,
    memory_bytes: u64,
    mut clip_sha256: Vec<String>,
) -> Result<SeenWorker> {
    if worker.is_empty() {
        return Err(Error::invalid("worker", "is missing"));
    }
    text::display_name("worker", &worker)?;
    text::display_name("device", &device)?;
    text::display_name("version", &version)?;
    let count = clip_sha256.len();
    if count > MAX_CLIPS {
        return Err(Error::invalid(
            "clip_sha256",
            format!("has {count} entries, at most {MAX_CLIPS} are taken"),
        ));
    }
    let digit = |b: u8| b.is_ascii_digit() || (b'a'..=b'f').contains(&b);
    for (i, hash) in clip_sha256.iter().enumerate() {
        if hash.len() != 64 || !hash.bytes().all(digit) {
            return Err(Error::invalid(
                format!("clip_sha256[{i}]"),
                "must be 64 lower-case hexadecimal digits",
            ));
        }
    }
    clip_sha256.sort();
    clip_sha256.dedup();
    Ok(SeenWorker {
        name: worker,
        device,
        version,
        memory: (memory_bytes > 0).then(|| i64::try_from(memory_bytes).unwrap_or(i64::MAX)),
        clips: clip_sha256,
    })
}

/// A worker is not given what it can't hold for certain. What it can probably not hold goes to one that has more memory,
/// as long as there is one with the same CLIPs.
fn capabilities(worker: &SeenWorker, seen: &[SeenWorker]) -> WorkerCapabilities {
    let has_more = |other: &SeenWorker| match (other.memory, worker.memory) {
        (_, None) => false,
        (None, Some(_)) => true,
        (Some(other), Some(own)) => other > own,
    };
    let has_the_same = |other: &SeenWorker| {
        let can = |clip| other.clips.contains(clip);
        other.clips.is_empty() || !worker.clips.is_empty() && worker.clips.iter().all(can)
    };
    let larger = seen.iter().any(|other| has_more(other) && has_the_same(other));
    WorkerCapabilities {
        worker: worker.name.clone(),
        memory: worker.memory,
        likely_memory: worker.memory.filter(|_| larger),
        clips: worker.clips.clone(),
    }
}

/// Why none of the workers could be given a job, if that is so.
fn waiting_reason(requirements: &ResourceRequirements, seen: &[SeenWorker]) -> Option<String> {
    let loads = |worker: &&SeenWorker| {
        let needed = requirements.clip.as_ref();
        worker.clips.is_empty() || needed.is_none_or(|clip| worker.clips.contains(clip))
    };
    let holds = |worker: &&SeenWorker| match (requirements.memory, worker.memory) {
        (Some(needed), Some(there)) => needed <= there,
        _ => true,
    };
    if seen.is_empty() {
        return Some(format!("no worker asked for a job in the last {} s", LATELY.as_secs()));
    }
    if seen.iter().any(|worker| loads(&worker) && holds(&worker)) {
        return None;
    }
    if let Some(clip) = &requirements.clip
        && !seen.iter().any(|worker| loads(&worker))
    {
        return Some(format!(
            "none of the workers that are there, {} of them, has the CLIP of its key, whose SHA-256 is {clip}",
            seen.len()
        ));
    }
    let most = seen.iter().filter(loads).filter_map(|worker| worker.memory).max();
    Some(format!(
        "it needs at least {:.1} GiB of memory, and none of the workers that are there, {} of them, gives a job more \
         than {:.1} GiB",
        requirements.memory.unwrap_or(0) as f64 / GIB,
        seen.len(),
        most.unwrap_or(0) as f64 / GIB
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worker(memory: Option<i64>, clips: &[&str]) -> SeenWorker {
        SeenWorker {
            name: format!("{memory:?}{clips:?}"),
            device: String::new(),
            version: String::new(),
            memory: memory.map(|gib| gib << 30),
            clips: clips.iter().map(|&clip| clip.into()).collect(),
        }
    }

    #[test]
    fn what_may_be_too_large_is_left_to_a_larger_worker() {
        let small = worker(Some(2), &[]);
        let likely = |seen: &[SeenWorker]| capabilities(&small, seen).likely_memory;
        assert_eq!(capabilities(&small, &[]).memory, Some(2 << 30));
        for no_larger in [
            &[][..],
            std::slice::from_ref(&small),
            &[worker(Some(1), &[])],
            &[worker(Some(9), &["a"])],
        ] {
            assert_eq!(likely(no_larger), None);
        }
        for larger in [worker(Some(3), &[]), worker(None, &[])] {
            assert_eq!(likely(&[small.clone(), larger]), Some(2 << 30));
        }
        let small = worker(Some(2), &["a", "b"]);
        assert_eq!(capabilities(&small, &[worker(Some(9), &["b"])]).likely_memory, None);
        let likely = capabilities(&small, &[worker(Some(9), &["c", "b", "a"])]).likely_memory;
        assert_eq!(likely, Some(2 << 30));
        assert_eq!(
            capabilities(&worker(None, &[]), &[worker(None, &[])]).likely_memory,
            None
        );
    }

    #[test]
    fn a_job_that_nobody_can_have_is_told_why() {
        let requirements = |gib: i64, clip: &str| ResourceRequirements {
            memory: Some(gib << 30),
            likely_memory: None,
            clip: (!clip.is_empty()).then(|| clip.into()),
        };
        let said = |requirements: &ResourceRequirements, seen: &[SeenWorker]| {
            waiting_reason(requirements, seen).unwrap_or_default()
        };
        assert!(said(&ResourceRequirements::default(), &[]).contains("120 s"));
        let seen = [worker(Some(4), &["a"]), worker(Some(8), &["b"])];
        for fine in [
            requirements(4, "a"),
            requirements(8, "b"),
            requirements(8, ""),
            ResourceRequirements::default(),
        ] {
            assert_eq!(said(&fine, &seen), "");
        }
        let told = said(&requirements(5, "a"), &seen);
        assert!(told.contains("5.0 GiB") && told.contains("more than 4.0 GiB"), "{told}");
        assert!(said(&requirements(9, ""), &seen).contains("more than 8.0 GiB"));
        assert!(said(&requirements(1, "c"), &seen).contains("SHA-256 is c"));
        assert_eq!(said(&requirements(99, "c"), &[worker(None, &[])]), "");
    }

    #[test]
    fn a_worker_is_noted_now_and_then_and_when_it_changed() {
        let (workers, begin) = (Placement::default(), Instant::now());
        let (one, other) = (worker(Some(1), &[]), worker(Some(2), &[]));
        assert!(workers.due(&one, begin));
        assert!(!workers.due(&one, begin));
        assert!(workers.due(&other, begin));
        let changed = SeenWorker {
            memory: None,
            ..one.clone()
        };
        assert!(workers.due(&changed, begin));
        assert!(!workers.due(&changed, begin + NOTE_EVERY / 2));
        assert!(workers.due(&changed, begin + NOTE_EVERY));
        assert!(workers.due(&changed, begin + LATELY * 2));
        assert_eq!(workers.noted.lock().unwrap().len(), 1);
    }
}
