//! What every ledger must do with hooks and deliveries.
use std::collections::HashSet;
use std::sync::Arc;

use uuid::Uuid;

use super::super::{
    Busy, DeliveryFilter, DeliveryRow, DeliveryState, HookId, HookRow, JobId, JobKind, JobState, Ledger, LedgerError,
    MOST_WAITING, NewHook, NewJob, Sending, Topics,
};
use super::Factory;
use super::fixture::*;

fn new_hook(project: &str, topics: Topics) -> NewHook {
    NewHook {
        id: Uuid::now_v7(),
        project: project.into(),
        display_name: "the shop".into(),
        url: "https://shop.example/hook".into(),
        topics,
        sealed_secret: vec![5; 7],
    }
}

async fn hook(ledger: &dyn Ledger, topics: Topics) -> HookId {
    let new = new_hook(OURS, topics);
    ledger.create_hook(new, at(0)).await.expect("a hook is kept").id
}

async fn deliveries(ledger: &dyn Ledger) -> Vec<DeliveryRow> {
    let all = ledger
        .list_deliveries(OURS, DeliveryFilter::default(), None, 1000)
        .await;
    all.expect("deliveries are listed")
}

async fn claim_delivery(ledger: &dyn Ledger, now: i64) -> Option<Sending> {
    let claimed = ledger.claim_delivery(&Busy::default(), LEASE, now).await;
    claimed.expect("the ledger can be claimed from")
}

/// A job that was cancelled at a time, so that it is over.
async fn over(ledger: &dyn Ledger, now: i64) -> JobId {
    let id = queue(ledger, now).await;
    ledger.cancel_job(id, now).await.expect("a job is cancelled").id
}

pub async fn a_hook_is_kept_listed_and_deleted(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let topics = Topics {
        kinds: vec![JobKind::Embed, JobKind::CreateKey],
        states: vec![JobState::Failed],
    };
    let new = new_hook(OURS, topics.clone());
    let kept = ledger.create_hook(new.clone(), at(1)).await.unwrap();
    let expected = HookRow {
        id: new.id,
        project: OURS.into(),
        display_name: new.display_name,
        url: new.url,
        topics,
        sealed_secret: new.sealed_secret,
        create_time: at(1),
    };
    assert!(kept == expected);
    drop(ledger);
    let ledger = factory.open().await;
    assert!(ledger.get_hook(expected.id).await.unwrap() == Some(expected.clone()));
    let theirs = ledger
        .create_hook(new_hook("theirs", Topics::default()), at(2))
        .await
        .unwrap();
    let newer = ledger
        .create_hook(new_hook(OURS, Topics::default()), at(3))
        .await
        .unwrap();
    let list = async |before, limit| ledger.list_hooks(OURS, before, limit).await.unwrap();
    assert_eq!(list(None, 5).await, [newer.clone(), expected.clone()]);
    assert_eq!(list(None, 1).await, std::slice::from_ref(&newer));
    let after = list(Some((newer.create_time, newer.id)), 5).await;
    assert_eq!(after, std::slice::from_ref(&expected));
    ledger.delete_hook(newer.id).await.unwrap();
    assert_eq!(list(None, 5).await, [expected]);
    assert_eq!(ledger.list_hooks("theirs", None, 5).await.unwrap(), [theirs]);
    refused!(
        ledger.delete_hook(newer.id).await,
        LedgerError::NotFound { kind: "hook", .. }
    );
}

/// However a job ends, its end and the delivery are one.
pub async fn every_end_of_a_job_makes_one_delivery(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let before = queue(&*ledger, at(0)).await;
    ledger.cancel_job(before, at(0)).await.unwrap();
    let hook = hook(&*ledger, Topics::default()).await;
    let mut expected = Vec::new();

    // Done.
    let id = queue(&*ledger, at(1)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    complete(&*ledger, &lease, &[], at(2)).await;
    complete(&*ledger, &lease, &[], at(3)).await; // said again
    expected.push((id, JobState::Succeeded, at(2)));
    // Failed.
    let id = queue(&*ledger, at(4)).await;
    let lease = claim_of(&*ledger, id, at(4)).await;
    let failed = ledger.fail(id, &lease.token, failure("no"), false, false, at(5)).await;
    failed.unwrap();
    expected.push((id, JobState::Failed, at(5)));
    // Cancelled while it waited, and while it ran.
    expected.push((over(&*ledger, at(6)).await, JobState::Cancelled, at(6)));
    let id = queue(&*ledger, at(7)).await;
    let lease = claim_of(&*ledger, id, at(7)).await;
    ledger.cancel_job(id, at(7)).await.unwrap();
    ledger.fail(id, &lease.token, None, false, true, at(8)).await.unwrap();
    expected.push((id, JobState::Cancelled, at(8)));
    // Its last worker lost.
    let new = NewJob {
        max_attempts: 1,
        ..new_job()
    };
    let id = ledger.create_job(new, at(9)).await.unwrap().id;
    claim_of(&*ledger, id, at(9)).await;
    assert_eq!(ledger.reap(at(100)).await.unwrap(), [id]);
    expected.push((id, JobState::Failed, at(100)));
    // Without an attempt to give.
    let new = NewJob {
        max_attempts: 0,
        ..new_job()
    };
    let id = ledger.create_job(new, at(101)).await.unwrap().id;
    assert!(claim(&*ledger, at(102)).await.is_none());
    expected.push((id, JobState::Failed, at(102)));
    // Not over.
    let id = queue(&*ledger, at(103)).await;
    let lease = claim_of(&*ledger, id, at(103)).await;
    let retried = ledger
        .fail(id, &lease.token, failure("once"), true, false, at(104))
        .await;
    assert_eq!(retried.unwrap().state, JobState::Queued);

    let mut made: Vec<_> = deliveries(&*ledger).await;
    made.reverse();
    let told: Vec<_> = made.iter().map(|d| (d.job, d.job_state, d.create_time)).collect();
    assert_eq!(told, expected);
    for delivery in made {
        assert_eq!((delivery.hook, delivery.state), (hook, DeliveryState::Pending));
        assert_eq!((delivery.attempts, delivery.last_time), (0, None));
        assert_eq!(delivery.next_time, delivery.create_time);
    }
}

pub async fn a_hook_is_told_of_what_it_wants_only(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let theirs = ledger
        .create_hook(new_hook("theirs", Topics::default()), at(0))
        .await
        .unwrap();
    let keys = Topics {
        kinds: vec![JobKind::CreateKey, JobKind::Verify],
        states: Vec::new(),
    };
    let done = Topics {
        kinds: Vec::new(),
        states: vec![JobState::Succeeded, JobState::Failed],
    };
    let both = Topics {
        kinds: vec![JobKind::Embed],
        states: vec![JobState::Cancelled],
    };
    hook(&*ledger, keys).await;
    hook(&*ledger, done).await;
    let both = hook(&*ledger, both).await;
    let all = hook(&*ledger, Topics::default()).await;
    let job = over(&*ledger, at(1)).await;
    let told: HashSet<_> = deliveries(&*ledger).await.iter().map(|d| (d.hook, d.job)).collect();
    assert_eq!(told, HashSet::from([(both, job), (all, job)]));
    let of_theirs = ledger.list_deliveries("theirs", DeliveryFilter::default(), None, 5);
    assert_eq!(of_theirs.await.unwrap(), []);
    assert!(ledger.get_hook(theirs.id).await.unwrap().is_some());
}

pub async fn a_delivery_is_sent_until_it_is_acknowledged(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let hook = hook(&*ledger, Topics::default()).await;
    let asked = Uuid::new_v4();
    let new = NewJob {
        request_id: Some(Uuid::new_v4()),
        asked_id: Some(asked),
        ..new_job()
    };
    let id = ledger.create_job(new, at(0)).await.unwrap().id;
    ledger.cancel_job(id, at(1)).await.unwrap();
    assert!(claim_delivery(&*ledger, at(0)).await.is_none(), "not due yet");
    for (busy, what) in [
        (vec![Uuid::new_v4(), hook], vec![]),
        (vec![], vec!["nobody".to_owned(), OURS.to_owned()]),
    ] {
        let busy = Busy {
            hooks: busy,
            projects: what,
        };
        let claimed = ledger.claim_delivery(&busy, LEASE, at(2)).await;
        assert!(claimed.unwrap().is_none(), "{busy:?}");
    }

    let first = claim_delivery(&*ledger, at(2)).await.expect("it is due");
    assert_eq!((first.hook.id, first.delivery.attempts), (hook, 1));
    assert_eq!(
        first.job.as_ref().map(|job| (job.id, job.state)),
        Some((id, JobState::Cancelled))
    );
    assert_eq!(first.asked_id, Some(asked));
    assert!(claim_delivery(&*ledger, at(3)).await.is_none(), "it is leased");
    let name = first.delivery.id;
    // The first text is kept, whoever has another.
    assert_eq!(first.body, None);
    for (token, body, kept) in [
        ("another", "no", false),
        (&first.token, "once", true),
        (&first.token, "twice", true),
    ] {
        let done = ledger.keep_delivery_body(name, token, body.as_bytes()).await;
        assert_eq!(done.unwrap(), kept, "{body}");
    }
    let next = Some(at(50));
    assert!(!ledger.not_delivered(name, "another", "no", next, at(4)).await.unwrap());
    assert!(
        ledger
            .not_delivered(name, &first.token, "no\0", next, at(4))
            .await
            .unwrap()
    );
    assert!(
        !ledger.delivered(name, &first.token, at(5)).await.unwrap(),
        "one word only"
    );
    let waiting = ledger.get_delivery(name).await.unwrap().unwrap();
    assert_eq!((waiting.state, waiting.next_time), (DeliveryState::Pending, at(50)));
    assert!(waiting.last_error.starts_with("no") && waiting.last_time == Some(at(2)));

    assert!(claim_delivery(&*ledger, at(49)).await.is_none());
    let second = claim_delivery(&*ledger, at(50)).await.expect("it is due again");
    assert_eq!((second.delivery.id, second.delivery.attempts), (name, 2));
    assert_eq!(second.body.as_deref(), Some(&b"once"[..]));
    assert!(ledger.delivered(name, &second.token, at(51)).await.unwrap());
    let done = ledger.get_delivery(name).await.unwrap().unwrap();
    assert_eq!((done.state, done.end_time), (DeliveryState::Delivered, Some(at(51))));
    assert_eq!(done.last_error, "");
    assert!(claim_delivery(&*ledger, at(9_999)).await.is_none());
}

pub async fn a_delivery_is_given_up_and_sent_again(factory: &dyn Factory) {
    let ledger = factory.open().await;
    hook(&*ledger, Topics::default()).await;
    over(&*ledger, at(0)).await;
    let sending = claim_delivery(&*ledger, at(1)).await.unwrap();
    let id = sending.delivery.id;
    let leased = ledger.redeliver(id, at(2)).await.unwrap();
    assert_eq!(leased, sending.delivery, "it is being sent");
    assert!(
        ledger
            .not_delivered(id, &sending.token, "answered 500", None, at(3))
            .await
            .unwrap()
    );
    let dead = ledger.get_delivery(id).await.unwrap().unwrap();
    assert_eq!((dead.state, dead.end_time), (DeliveryState::Dead, Some(at(3))));
    assert_eq!(dead.last_error, "answered 500");
    assert!(claim_delivery(&*ledger, at(100)).await.is_none());

    let again = ledger.redeliver(id, at(200)).await.unwrap();
    assert_eq!(
        (again.state, again.attempts, again.since),
        (DeliveryState::Pending, 0, at(200))
    );
    assert_eq!((again.create_time, again.end_time), (at(0), None));
    let sending = claim_delivery(&*ledger, at(200)).await.unwrap();
    assert_eq!((sending.delivery.id, sending.delivery.attempts), (id, 1));
    assert!(ledger.delivered(id, &sending.token, at(201)).await.unwrap());
    // What was acknowledged may be wanted once more, too.
    assert_eq!(
        ledger.redeliver(id, at(300)).await.unwrap().state,
        DeliveryState::Pending
    );
    let unknown = ledger.redeliver(Uuid::now_v7(), at(300)).await;
    refused!(unknown, LedgerError::NotFound { kind: "delivery", .. });
}

pub async fn a_delivery_that_was_lost_is_given_to_another(factory: &dyn Factory) {
    let ledger = factory.open().await;
    hook(&*ledger, Topics::default()).await;
    over(&*ledger, at(0)).await;
    let lost = claim_delivery(&*ledger, at(1)).await.unwrap();
    drop(ledger);
    let ledger = factory.open().await;
    assert!(claim_delivery(&*ledger, at(30)).await.is_none());
    let found = claim_delivery(&*ledger, at(31)).await.expect("the lease is over");
    assert_eq!(found.delivery.id, lost.delivery.id);
    assert!(!ledger.delivered(lost.delivery.id, &lost.token, at(32)).await.unwrap());
    let pending = ledger.get_delivery(found.delivery.id).await.unwrap().unwrap();
    assert_eq!(pending.state, DeliveryState::Pending);
    assert!(ledger.delivered(found.delivery.id, &found.token, at(33)).await.unwrap());
}

pub async fn servers_never_share_a_delivery(factory: &dyn Factory) {
    const EACH: usize = 24;
    let servers = factory.open_several(4).await;
    hook(&*servers[0], Topics::default()).await;
    for _ in 0..EACH {
        over(&*servers[0], at(0)).await;
    }
    let claims = servers.into_iter().map(|ledger: Arc<dyn Ledger>| {
        tokio::spawn(async move {
            let mut got = Vec::new();
            while let Some(sending) = claim_delivery(&*ledger, at(1)).await {
                got.push(sending.delivery.id);
            }
            got
        })
    });
    let mut all = Vec::new();
    for claims in claims.collect::<Vec<_>>() {
        all.extend(claims.await.unwrap());
    }
    assert_eq!(all.len(), EACH);
    assert_eq!(all.iter().collect::<HashSet<_>>().len(), EACH);
}

pub async fn deliveries_come_in_pages_and_are_forgotten(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (one, two) = (
        hook(&*ledger, Topics::default()).await,
        hook(&*ledger, Topics::default()).await,
    );
    for i in 0..3 {
        over(&*ledger, at(i / 2)).await;
    }
    let all = deliveries(&*ledger).await;
    assert_eq!(all.len(), 6);
    let mut found: Vec<DeliveryRow> = Vec::new();
    loop {
        let before = found.last().map(|row| (row.create_time, row.id));
        let page = ledger.list_deliveries(OURS, DeliveryFilter::default(), before, 2).await;
        let page = page.unwrap();
        if page.is_empty() {
            break;
        }
        found.extend(page);
    }
    assert_eq!(found, all);
    let of = async |hook, state| {
        let filter = DeliveryFilter { hook, state };
        ledger.list_deliveries(OURS, filter, None, 100).await.unwrap()
    };
    for hook in [one, two] {
        let expected: Vec<_> = all.iter().filter(|row| row.hook == hook).cloned().collect();
        assert_eq!(of(Some(hook), None).await, expected);
    }
    let sending = claim_delivery(&*ledger, at(5)).await.unwrap();
    let id = sending.delivery.id;
    assert!(ledger.delivered(id, &sending.token, at(6)).await.unwrap());
    assert_eq!(of(None, Some(DeliveryState::Delivered)).await.len(), 1);
    assert_eq!(of(Some(sending.hook.id), Some(DeliveryState::Pending)).await.len(), 2);
    assert_eq!(of(None, Some(DeliveryState::Dead)).await, []);
    // What is pending is never forgotten.
    assert_eq!(ledger.forget_deliveries(at(6), 10).await.unwrap(), 0);
    assert_eq!(ledger.forget_deliveries(at(7), 10).await.unwrap(), 1);
    assert_eq!(ledger.get_delivery(id).await.unwrap(), None);
    // With a hook goes what it was to be sent.
    ledger.delete_hook(one).await.unwrap();
    assert!(deliveries(&*ledger).await.iter().all(|row| row.hook == two));
    assert_eq!(of(Some(one), None).await, []);
}

/// A job's end never fails because of a hook that goes at the same moment.
pub async fn a_hook_may_go_while_its_jobs_end(factory: &dyn Factory) {
    let servers = factory.open_several(2).await;
    let (one, two) = (servers[0].clone(), servers[1].clone());
    for _ in 0..8 {
        let id = queue(&*one, at(0)).await;
        let hook = hook(&*one, Topics::default()).await;
        let (there, here) = (two.clone(), one.clone());
        let going = tokio::spawn(async move { there.delete_hook(hook).await });
        let ended = tokio::spawn(async move { here.cancel_job(id, at(1)).await });
        going.await.unwrap().unwrap();
        assert_eq!(ended.await.unwrap().unwrap().state, JobState::Cancelled);
        assert_eq!(deliveries(&*one).await, []);
    }
}

/// Who floods their own hooks fills up neither the table nor the way of others.
pub async fn a_project_has_so_many_deliveries_waiting_and_no_more(factory: &dyn Factory) {
    let ledger = factory.open().await;
    // Each end of a job makes a delivery for every hook; a few hooks keep the number of jobs small.
    let hooks = 500;
    for _ in 0..hooks {
        hook(&*ledger, Topics::default()).await;
    }
    for job in 0..=MOST_WAITING / hooks {
        over(&*ledger, at(job)).await;
    }
    let count = async |state| {
        let filter = DeliveryFilter {
            hook: None,
            state: Some(state),
        };
        let all = ledger.list_deliveries(OURS, filter, None, 1 << 20).await.unwrap();
        (all.len() as i64, all)
    };
    assert_eq!(count(DeliveryState::Pending).await.0, MOST_WAITING);
    let (dead, all) = count(DeliveryState::Dead).await;
    assert_eq!(dead, hooks);
    assert!(
        all.iter()
            .all(|row| row.last_error.contains("10000") && row.end_time.is_some())
    );
    // They can still be asked for.
    let again = ledger.redeliver(all[0].id, at(100)).await.unwrap();
    assert_eq!(again.state, DeliveryState::Pending);
}
