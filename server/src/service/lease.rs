//! `LeaseJob` and `DownloadKey`: how a worker gets a job and the key that it needs.
use std::time::Duration;

use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{Job, LeaseJobRequest, LeaseJobResponse};
use secrecy::SecretSlice;
use tokio::sync::oneshot;
use tokio::time::Instant;

use crate::artifacts::ArtifactPath;
use crate::error::{Error, Result, chain};
use crate::ledger::{Failure, FailureReason, JobRow, JobSpec, KeyId, KeyRow, KeyState, Lease, WorkerCapabilities};
use crate::service::changes::For;
use crate::service::names::ResourceKind;
use crate::service::placement::described;
use crate::service::{Service, clock, seeds, to_proto};
use crate::traces;

const MAX_WAIT: Duration = Duration::from_secs(60);
/// How late a job is found that became ready by time alone, after a failed attempt.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

/// The least rate that workers can decide at.
const LEAST_RATE: f64 = 1e-30;

impl Service {
    /// Leases a job, waiting for one if need be.
    pub(crate) async fn lease(&self, request: LeaseJobRequest) -> Result<LeaseJobResponse> {
        let LeaseJobRequest {
            worker,
            wait,
            device,
            memory_bytes,
            clip_sha256,
            version,
        } = request;
        let worker = described(worker, device, version, memory_bytes, clip_sha256)?;
        let wait = clock::duration(wait.unwrap_or_default()).filter(|&wait| wait <= MAX_WAIT);
        let wait = wait.ok_or_else(|| Error::invalid("wait", "must be 0 to 60 seconds"))?;
        let end = Instant::now() + wait;
        let mut listener = self.changes().listen();
        let alive = self.workers();
        let _waiting = alive.wait();
        loop {
            listener.check_running()?;
            self.worker_is_there(&worker).await?;
            let capabilities = self.capabilities(&worker).await?;
            if let Some(lease) = self.claim(capabilities).await? {
                let (job, false_positive_rate) = match self.for_worker(&lease).await {
                    Ok(told) => told,
                    Err(error) => {
                        self.not_given(&lease, &error).await?;
                        continue;
                    }
                };
                return Ok(LeaseJobResponse {
                    job: Some(job),
                    trace_parent: lease.job.trace_parent.unwrap_or_default(),
                    lease_token: lease.token,
                    lease_duration: Some(clock::proto_duration(self.limits().lease)),
                    false_positive_rate,
                });
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(LeaseJobResponse::default());
            }
            listener.wait(For::Work, left.min(LOOK_AGAIN)).await?;
        }
    }

    /// A job as its worker is told it, with the word to embed where that is an asset's, and the seed of a key; and the rate
    /// to decide at.
    async fn for_worker(&self, lease: &Lease) -> Result<(Job, f64)> {
        let mut job = to_proto::job(lease.job.clone());
        let mut rate = self.limits().false_positive_rate;
        if let JobSpec::CreateKey(order) = &lease.job.spec {
            job.spec = Some(Spec::CreateKey(seeds::opened(self.master(), lease.job.id, order)?));
        }
        if let Some(Spec::Embed(spec)) = &mut job.spec
            && let Some(word) = self.word_of(spec).await?
        {
            spec.message = word;
            // A claim pays for all assets of the key, so a mark must be as strong as that takes.
            let key = ResourceKind::Key.parse("job.embed.key", &spec.key)?;
            let assets = self.ledger().count_assets(key, None).await?;
            rate = (rate / assets.max(1) as f64).max(LEAST_RATE);
        }
        Ok((job, rate))
    }

    /// Ends an attempt that could not begin.
    async fn not_given(&self, lease: &Lease, error: &Error) -> Result<()> {
        let id = lease.job.id;
        tracing::error!(job = %id, error = %chain(error), "could not be given to a worker");
        let failure = Failure {
            reason: FailureReason::Internal,
            message: error.to_string(),
        };
        let failed = self
            .ledger()
            .fail(id, &lease.token, Some(failure), true, false, clock::now());
        self.attempt_over(&failed.await?);
        Ok(())
    }

    /// Claims a job. Should the caller be gone by the time it is claimed, it is handed back at once: otherwise an
    /// attempt would be lost, and the time of a lease with it.
    async fn claim(&self, capabilities: WorkerCapabilities) -> Result<Option<Lease>> {
        let (send, receive) = oneshot::channel();
        let api = self.clone();
        tokio::spawn(async move {
            let mut claimed = api
                .ledger()
                .claim_for(&capabilities, api.limits().lease, clock::now())
                .await;
            if let Ok(Some(lease)) = &mut claimed {
                tracing::info!(job = %lease.job.id, worker = capabilities.worker, attempt = lease.job.attempt, "job given to a worker");
                api.metrics().given(&lease.job);
                let span = api.traces().attempt(&lease.job);
                // The worker's spans go below the attempt's.
                if let Some(span) = &span {
                    lease.job.trace_parent = Some(traces::text(traces::context(span)));
                }
                let (id, kind, now) = (lease.job.id, lease.job.kind(), Instant::now().into_std());
                api.stages().begin(id, kind, span, now);
                api.changes().job(lease.job.id);
                api.changes().queue_moved();
            }
            if let Err(Ok(Some(lease))) = send.send(claimed) {
                let id = lease.job.id;
                match api.ledger().release(id, &lease.token, clock::now()).await {
                    Ok(job) => {
                        api.ended(&job);
                        api.changes().job(id);
                    }
                    Err(error) => {
                        tracing::warn!(job = %id, error = %chain(&error), "not taken back from a worker that left");
                    }
                }
                api.changes().queue_grew();
            }
        });
        let claimed = receive
            .await
            .map_err(|error| Error::internal("claiming a job", error))?;
        Ok(claimed?)
    }

    /// The key file that a leased job needs, for whoever has the lease.
    pub(crate) async fn key_file(&self, job: &str, token: &str) -> Result<SecretSlice<u8>> {
        let id = ResourceKind::Job.parse("job", job)?;
        let job = self.ledger().leased_job(id, token).await?;
        let id = needed_key(&job)?.ok_or_else(|| Error::invalid("job", "is the name of a job that needs no key"))?;
        let key = self
            .ledger()
            .get_key(id)
            .await?
            .ok_or_else(|| ResourceKind::Key.not_found(id))?;
        if key.state == KeyState::Revoked {
            return Err(self.fail_revoked(&job, token, &key).await);
        }
        let file = self.ledger().get_any_artifact(key.artifact).await?;
        let file = file.ok_or_else(|| Error::internal("finding a key file", "the ledger has no such artifact"))?;
        Ok(self
            .store()
            .read_sealed(&ArtifactPath::parse(&file.path)?, self.master())
            .await?)
    }

    /// Ends a job whose key was revoked after it was queued, so that its owner hears of it in these words, whatever the
    /// worker makes of the refusal.
    async fn fail_revoked(&self, job: &JobRow, token: &str, key: &KeyRow) -> Error {
        let refusal = Error::KeyRevoked {
            name: ResourceKind::Key.name(key.id),
        };
        let failure = Failure {
            reason: FailureReason::InvalidInput,
            message: format!("{refusal}; the reason that was given: {}", key.state_reason),
        };
        let failed = self
            .ledger()
            .fail(job.id, token, Some(failure), false, false, clock::now())
            .await;
        match failed {
            Ok(job) => {
                self.attempt_over(&job);
                refusal
            }
            Err(error) => error.into(),
        }
    }
}

pub(crate) fn needed_key(job: &JobRow) -> Result<Option<KeyId>> {
    let name = match &job.spec {
        JobSpec::Embed(spec) => &spec.key,
        JobSpec::Verify(spec) => &spec.key,
        JobSpec::CreateKey(_) => return Ok(None),
    };
    ResourceKind::Key.parse("job.key", name).map(Some)
}
