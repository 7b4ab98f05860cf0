//! Sends what hooks are to be told, until it is acknowledged or given up. Several servers share the work: each delivery is
//! given to one at a time, under a lease.
use std::collections::HashMap;
use std::time::Duration;

use secrecy::ExposeSecret;
use tokio::task::{Id, JoinSet};
use tokio::time::{Instant, interval, timeout};

use crate::error::{Error, chain};
use crate::hooks::{PostError, Poster, event, next_attempt, signature};
use crate::ledger::{Busy, HookId, Sending};
use crate::service::{Service, clock, text};

/// How often what is due is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// Messages on their way at a time.
const AT_ONCE: usize = 32;
/// Those of them to one hook, so that one that answers slowly does not hold up the others.
const OF_ONE_HOOK: usize = 4;
/// Those of them to all hooks of a project, so that many that answer slowly do not hold up those of others.
const OF_ONE_PROJECT: usize = 8;
/// When another server may send what this one was to: longer than any message takes.
const LEASE: Duration = Duration::from_secs(60);
/// What is on its way gets so long to arrive when the server stops. What does not is sent again.
const GRACE: Duration = Duration::from_millis(800);
/// How long is known what became of deliveries.
const KEEP: Duration = Duration::from_secs(30 * 24 * 60 * 60);
/// How often, and how many at a time, older ones are forgotten.
const FORGET_EVERY: Duration = Duration::from_secs(60);
const FORGET_AT_ONCE: u32 = 1000;
/// Longest reason that is kept, in bytes.
const LONGEST_ERROR: usize = 300;

/// Why an attempt came to nothing.
#[derive(Debug, thiserror::Error)]
enum Failed {
    /// There is nothing left to tell of.
    #[error("the job is gone")]
    JobGone,
    /// Another server has it.
    #[error("the delivery was given to another server")]
    Lost,
    /// The receiver was not reached, or did not acknowledge.
    #[error(transparent)]
    Post(#[from] PostError),
    /// This side failed.
    #[error(transparent)]
    Service(#[from] Error),
}

/// Sends until the API is stopped. A failure of the ledger is logged, and tried again the next time.
pub async fn deliveries(api: Service, poster: Poster) {
    let mut stopping = api.changes().listen();
    let mut ticks = interval(LOOK_EVERY);
    let mut forgot: Option<Instant> = None;
    let mut sending = JoinSet::new();
    let mut under_way: HashMap<Id, (HookId, String)> = HashMap::new();
    loop {
        tokio::select! {
            () = stopping.stopped() => break,
            Some(done) = sending.join_next_with_id() => {
                let id = done.map_or_else(|failed| failed.id(), |(id, ())| id);
                under_way.remove(&id);
            }
            _ = ticks.tick() => {}
        }
        while under_way.len() < AT_ONCE {
            let busy = busy(under_way.values());
            match api.ledger().claim_delivery(&busy, LEASE, clock::now()).await {
                Ok(Some(claimed)) => {
                    let (api, poster) = (api.clone(), poster.clone());
                    let whose = (claimed.hook.id, claimed.hook.project.clone());
                    let task = sending.spawn(async move { api.deliver(&poster, claimed, clock::now()).await });
                    under_way.insert(task.id(), whose);
                }
                Ok(None) => break,
                Err(error) => {
                    tracing::error!(error = %chain(&error), "what hooks are to be told can't be read");
                    break;
                }
            }
        }
        if forgot.is_none_or(|at| at.elapsed() >= FORGET_EVERY) {
            forgot = Some(Instant::now());
            let older_than = clock::now().saturating_sub(clock::micros(KEEP));
            if let Err(error) = api.ledger().forget_deliveries(older_than, FORGET_AT_ONCE).await {
                tracing::error!(error = %chain(&error), "old deliveries could not be removed");
            }
        }
    }
    let rest = async { while sending.join_next().await.is_some() {} };
    if timeout(GRACE, rest).await.is_err() {
        tracing::info!("messages to hooks are cut off, and will be sent again");
    }
}

/// Hooks and projects that have as many messages on their way as they may.
fn busy<'a>(under_way: impl Iterator<Item = &'a (HookId, String)>) -> Busy {
    let mut hooks: HashMap<HookId, usize> = HashMap::new();
    let mut projects: HashMap<&str, usize> = HashMap::new();
    for (hook, project) in under_way {
        *hooks.entry(*hook).or_default() += 1;
        *projects.entry(project).or_default() += 1;
    }
    let hooks = hooks.into_iter().filter(|&(_, count)| count >= OF_ONE_HOOK);
    let projects = projects.into_iter().filter(|&(_, count)| count >= OF_ONE_PROJECT);
    Busy {
        hooks: hooks.map(|(hook, _)| hook).collect(),
        projects: projects.map(|(project, _)| project.to_owned()).collect(),
    }
}

impl Service {
    /// Sends one delivery, and notes what came of it. The attempt begins at `now`.
    pub(crate) async fn deliver(&self, poster: &Poster, sending: Sending, now: i64) {
        let begun = Instant::now();
        let (id, hook) = (sending.delivery.id, sending.hook.id);
        let outcome = self.attempt(poster, &sending, now).await;
        let now = now.saturating_add(clock::micros(begun.elapsed()));
        let noted = match &outcome {
            Ok(()) => {
                tracing::info!(delivery = %id, %hook, attempts = sending.delivery.attempts, "acknowledged");
                self.ledger().delivered(id, &sending.token, now).await
            }
            Err(error) => {
                let next = match error {
                    Failed::JobGone => None,
                    _ => next_attempt(&sending.delivery, self.limits().hooks.give_up_after, now),
                };
                let error = text::shortened(error.to_string(), LONGEST_ERROR);
                let attempts = sending.delivery.attempts;
                match next {
                    Some(_) => tracing::warn!(delivery = %id, %hook, attempts, error, "not acknowledged"),
                    None => tracing::error!(delivery = %id, %hook, attempts, error, "never acknowledged, and given up"),
                }
                self.ledger().not_delivered(id, &sending.token, &error, next, now).await
            }
        };
        // What was not noted is sent again when its lease ends.
        match noted {
            Ok(true) => {}
            Ok(false) => tracing::warn!(delivery = %id, "took so long that another server has it, or its hook is gone"),
            Err(error) => tracing::error!(delivery = %id, error = %chain(&error), "the outcome could not be noted"),
        }
    }

    /// What is sent: at every attempt what was sent at the first, whatever has become of the job and its artifacts since.
    async fn event_of(&self, sending: &Sending) -> Result<Vec<u8>, Failed> {
        if let Some(body) = &sending.body {
            return Ok(body.clone());
        }
        let job = sending.job.as_ref().ok_or(Failed::JobGone)?;
        let mut artifacts = Vec::new();
        for (role, artifact) in event::outputs(job) {
            // One that was deleted meanwhile is not told of.
            if let Some(row) = self.find_artifact(&job.project, artifact).await? {
                artifacts.push((role, row));
            }
        }
        let body = event::body(
            &sending.delivery,
            job,
            self.limits().raw_verification,
            sending.asked_id,
            artifacts,
        );
        let kept = self
            .ledger()
            .keep_delivery_body(sending.delivery.id, &sending.token, &body);
        match kept.await.map_err(Error::from)? {
            true => Ok(body),
            // Whoever has it now keeps another text, perhaps.
            false => Err(Failed::Lost),
        }
    }

    async fn attempt(&self, poster: &Poster, sending: &Sending, now: i64) -> Result<(), Failed> {
        let Sending { delivery, hook, .. } = sending;
        let body = self.event_of(sending).await?;
        let secret = self
            .master()
            .open(&crate::hooks::secret_context(hook.id), &hook.sealed_secret);
        let secret = secret.map_err(|error| Error::internal("opening the hook's secret", error))?;
        let (id, seconds) = (delivery.id.to_string(), now.div_euclid(1_000_000));
        let signed = signature::sign(secret.expose_secret(), &id, seconds, &body).unwrap_or_default();
        let headers = [
            ("content-type", event::CONTENT_TYPE.to_owned()),
            (signature::ID, id),
            (signature::TIMESTAMP, seconds.to_string()),
            (signature::SIGNATURE, signed),
        ];
        poster.post(&hook.url, &headers, body).await?;
        Ok(())
    }
}
