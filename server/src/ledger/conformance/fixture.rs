//! Short words for what the tests do all the time.
use std::time::Duration;

use guardsplat_proto::v1::{EmbedResult, EmbedSpec, KeyResult, VerifyResult, VerifySpec};
use uuid::Uuid;

use super::super::{
    ArtifactId, ArtifactState, Completion, Failure, FailureReason, JobId, JobKind, JobResult, JobRow, JobSpec,
    KeyOrder, Lease, Ledger, LedgerError, NewArtifact, NewJob, Origin, Progress, ResourceRequirements,
};

/// How long the leases of the tests are.
pub const LEASE: Duration = Duration::from_secs(30);

/// So many seconds after the tests' beginning of time.
pub fn at(seconds: i64) -> i64 {
    1_700_000_000_000_000 + seconds * 1_000_000
}

/// The project of the tests that are about no project.
pub const OURS: &str = "default";

/// That we send it.
pub fn by_us() -> Origin {
    Origin::Upload { project: OURS.into() }
}

/// A spec of which there are several, all of one kind.
pub fn spec(message: u64) -> JobSpec {
    JobSpec::Embed(EmbedSpec {
        message: message.to_string(),
        ..EmbedSpec::default()
    })
}

/// A spec of a kind.
pub fn spec_of(kind: JobKind) -> JobSpec {
    match kind {
        JobKind::Embed => spec(123),
        JobKind::Verify => JobSpec::Verify(VerifySpec::default()),
        JobKind::CreateKey => JobSpec::CreateKey(KeyOrder { bits: 64, seed: None }),
    }
}

/// Progress of which there are several.
pub fn progress(done: u8) -> Progress {
    Progress {
        done: done.into(),
        ..Progress::default()
    }
}

/// A result of which there are several, for jobs of this kind.
pub fn result_of(kind: JobKind, said: u8) -> JobResult {
    match kind {
        JobKind::Embed => JobResult::Embed(EmbedResult {
            steps: said.into(),
            ..EmbedResult::default()
        }),
        JobKind::Verify => JobResult::Verify(VerifyResult {
            bits: said.into(),
            ..VerifyResult::default()
        }),
        JobKind::CreateKey => JobResult::CreateKey(KeyResult {
            key: said.to_string(),
            ..KeyResult::default()
        }),
    }
}

pub fn new_job() -> NewJob {
    NewJob {
        id: Uuid::now_v7(),
        project: OURS.into(),
        display_name: "a scene".into(),
        spec: spec(123),
        inputs: Vec::new(),
        key: None,
        request_id: None,
        asked_id: None,
        fingerprint: [7; 32],
        max_attempts: 3,
        priority: 0,
        requirements: ResourceRequirements::default(),
        trace_parent: None,
    }
}

pub async fn queue(ledger: &dyn Ledger, now: i64) -> JobId {
    ledger.create_job(new_job(), now).await.expect("a job is queued").id
}

/// Queues a job of a project, with a priority.
pub async fn queue_of(ledger: &dyn Ledger, project: &str, priority: i32, now: i64) -> JobId {
    let new = NewJob {
        project: project.into(),
        priority,
        ..new_job()
    };
    ledger.create_job(new, now).await.expect("a job is queued").id
}

pub async fn job(ledger: &dyn Ledger, id: JobId) -> JobRow {
    ledger
        .get_job(id)
        .await
        .expect("the ledger can be read")
        .expect("the job is there")
}

pub async fn claim(ledger: &dyn Ledger, now: i64) -> Option<Lease> {
    ledger
        .claim("worker-1", LEASE, now)
        .await
        .expect("the ledger can be claimed from")
}

/// Claims the one job that is expected to be next.
pub async fn claim_of(ledger: &dyn Ledger, id: JobId, now: i64) -> Lease {
    let lease = claim(ledger, now).await.expect("a job is there to be claimed");
    assert_eq!(lease.job.id, id, "another job came first");
    lease
}

pub fn failure(message: &str) -> Option<Failure> {
    Some(Failure {
        reason: FailureReason::Internal,
        message: message.into(),
    })
}

pub fn new_artifact(origin: Origin, secret: bool) -> NewArtifact {
    let id = Uuid::now_v7();
    let path = format!("artifacts/{id}");
    NewArtifact {
        id,
        display_name: "scene.ply".into(),
        size: 10,
        sha256: "ab".repeat(32),
        origin,
        secret,
        evidence: false,
        path,
    }
}

pub async fn upload(ledger: &dyn Ledger, now: i64) -> ArtifactId {
    let new = new_artifact(by_us(), false);
    let id = ledger
        .create_artifact(new, now)
        .await
        .expect("an upload is announced")
        .id;
    ledger
        .artifact_ready(id, None, now)
        .await
        .expect("an upload is complete");
    id
}

/// An output that is announced, but whose bytes aren't all there.
pub async fn pending_output(ledger: &dyn Ledger, lease: &Lease, secret: bool, now: i64) -> ArtifactId {
    let origin = Origin::Output {
        job: lease.job.id,
        token: lease.token.clone(),
    };
    ledger
        .create_artifact(new_artifact(origin, secret), now)
        .await
        .expect("an output is announced")
        .id
}

pub async fn output(ledger: &dyn Ledger, lease: &Lease, secret: bool, now: i64) -> ArtifactId {
    let id = pending_output(ledger, lease, secret, now).await;
    let stored = ledger
        .artifact_ready(id, Some(&lease.token), now)
        .await
        .expect("an output is complete");
    assert_eq!(stored.state, ArtifactState::Stored);
    id
}

pub async fn complete(ledger: &dyn Ledger, lease: &Lease, outputs: &[ArtifactId], now: i64) -> JobRow {
    let said = Completion {
        result: result_of(lease.job.kind(), 9),
        ..completion(9, outputs)
    };
    let done = ledger.complete(lease.job.id, &lease.token, said, now);
    done.await.expect("a leased job can be completed")
}

/// That `result` came out of marking, with these outputs.
pub fn completion(result: u8, outputs: &[ArtifactId]) -> Completion {
    Completion {
        result: result_of(JobKind::Embed, result),
        outputs: outputs.to_vec(),
        key: None,
        credentials: None,
        fingerprint: [result; 32],
    }
}

/// Whether an artifact is seen from outside.
pub async fn visible(ledger: &dyn Ledger, id: ArtifactId) -> bool {
    ledger.get_artifact(id).await.expect("the ledger can be read").is_some()
}

pub fn is_lost<T>(result: &Result<T, LedgerError>) -> bool {
    matches!(result, Err(LedgerError::LeaseLost(_)))
}

/// That the result is an error of this form.
macro_rules! refused {
    ($result:expr, $pattern:pat $(if $guard:expr)?) => {
        match $result {
            Err($pattern) $(if $guard)? => {}
            Err(other) => panic!("refused for another reason: {other:?}"),
            Ok(_) => panic!("not refused"),
        }
    };
}
pub(crate) use refused;

/// No job at all.
pub const NONE: [JobId; 0] = [];
