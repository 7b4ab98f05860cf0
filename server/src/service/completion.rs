//! Checks what a worker says came out of a job, before it becomes the job's result.
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::{CompleteJobRequest, EmbedResult, EmbedSpec, KeyOutput, KeyResult, VerifyResult};
use prost::Message as _;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::ledger::{ArtifactId, Completion, JobKind, JobResult, JobRow, JobSpec, KeyOrder, NewCredentials, NewKey};
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{credentials, text, upload};

/// Most bytes of a result; figures and a few sentences need far less.
const MAX_RESULT_BYTES: usize = 64 << 10;

/// What becomes of the job.
struct Outcome {
    result: JobResult,
    outputs: Vec<ArtifactId>,
    key: Option<NewKey>,
    credentials: Option<NewCredentials>,
}

/// Checks what came out of `job`, as far as that can be said without the ledger.
pub fn check(job: &JobRow, told: CompleteJobRequest) -> Result<Completion> {
    let fingerprint = fingerprint(&told);
    let Outcome {
        result,
        outputs,
        key,
        credentials,
    } = match (&job.spec, told.result) {
        (JobSpec::Embed(spec), Some(Output::EmbedResult(result))) => embed(job, spec, result)?,
        (JobSpec::Verify(_), Some(Output::VerifyResult(result))) => verify(result)?,
        (JobSpec::CreateKey(spec), Some(Output::KeyOutput(output))) => key(job, spec, output)?,
        (_, None) => return Err(Error::invalid("result", "is missing")),
        (spec, Some(_)) => {
            let wanted = match spec.kind() {
                JobKind::Embed => "embed_result",
                JobKind::Verify => "verify_result",
                JobKind::CreateKey => "key_output",
            };
            return Err(Error::invalid(
                "result",
                format!("is of another kind than the job, must be {wanted}"),
            ));
        }
    };
    let length = match &result {
        JobResult::Embed(result) => result.encoded_len(),
        JobResult::Verify(result) => result.encoded_len(),
        JobResult::CreateKey(result) => result.encoded_len(),
    };
    if length > MAX_RESULT_BYTES {
        let reason = format!("has {length} bytes, at most {MAX_RESULT_BYTES} are taken");
        return Err(Error::invalid("result", reason));
    }
    Ok(Completion {
        result,
        outputs,
        key,
        credentials,
        fingerprint,
    })
}

/// SHA-256 of what the worker said; not of the result, in which a key has a name that is drawn anew every time.
fn fingerprint(told: &CompleteJobRequest) -> [u8; 32] {
    let mut told = told.clone();
    // Which attempt it is, the ledger looks at.
    told.lease_token.clear();
    // MetricsLayer anew when it is said again.
    (told.peak_memory_bytes, told.peak_device_memory_bytes) = (None, None);
    Sha256::digest(told.encode_to_vec()).into()
}

fn embed(job: &JobRow, spec: &EmbedSpec, mut result: EmbedResult) -> Result<Outcome> {
    let mut problems = Violations::default();
    let scene = problems.take(ResourceKind::Artifact.parse("embed_result.scene", &result.scene))?;
    let comparison = problems.take(ResourceKind::Artifact.parse("embed_result.comparison", &result.comparison))?;
    problems.check(
        scene.is_none() || scene != comparison,
        "embed_result.comparison",
        "is the scene, must be another output",
    );
    let credentials = problems
        .take(credentials::told(spec, result.credentials.as_ref()))?
        .flatten();
    let sidecar = credentials.as_ref().map(|new| new.artifact);
    problems.check(
        sidecar.is_none() || ![scene, comparison].contains(&sidecar),
        "embed_result.credentials.artifact",
        "is the scene or the comparison, must be another output",
    );
    problems.finish()?;
    if let Some(told) = &mut result.credentials {
        told.job = ResourceKind::Job.name(job.id);
    }
    let outputs = scene.into_iter().chain(comparison).chain(sidecar).collect();
    Ok(Outcome {
        result: JobResult::Embed(result),
        outputs,
        key: None,
        credentials,
    })
}

fn verify(mut result: VerifyResult) -> Result<Outcome> {
    use guardsplat_proto::v1::verify_result::Verdict;
    let verdict = Verdict::try_from(result.verdict)
        .ok()
        .filter(|&v| v != Verdict::Unspecified);
    if verdict.is_none() {
        return Err(Error::invalid("verify_result.verdict", "is missing or not known"));
    }
    // The server alone knows of any.
    result.credentials.clear();
    Ok(Outcome {
        result: JobResult::Verify(result),
        outputs: Vec::new(),
        key: None,
        credentials: None,
    })
}

fn key(job: &JobRow, order: &KeyOrder, output: KeyOutput) -> Result<Outcome> {
    let mut problems = Violations::default();
    let artifact = problems.take(ResourceKind::Artifact.parse("key_output.key_file", &output.key_file))?;
    let told = output.key.unwrap_or_default();
    problems.check(
        told.bits == order.bits,
        "key_output.key.bits",
        "must be the bits that were asked for",
    );
    problems.check(
        told.seeded == order.seed.is_some(),
        "key_output.key.seeded",
        "must say whether the job was given a seed",
    );
    problems.check(!told.clip.is_empty(), "key_output.key.clip", "is missing");
    problems.take(text::display_name("key_output.key.clip", &told.clip))?;
    problems.check(
        upload::digest(&told.clip_sha256).is_some(),
        "key_output.key.clip_sha256",
        "must be 64 hexadecimal digits in lower case",
    );
    problems.check(output.result.is_some(), "key_output.result", "is missing");
    problems.finish()?;
    let id = Uuid::now_v7();
    // A key file that is missing was a problem above.
    let artifact = artifact.ok_or_else(|| Error::invalid("key_output.key_file", "is missing"))?;
    let result = KeyResult {
        key: ResourceKind::Key.name(id),
        ..output.result.unwrap_or_default()
    };
    let key = NewKey {
        id,
        display_name: job.display_name.clone(),
        bits: told.bits,
        clip: told.clip,
        clip_sha256: told.clip_sha256,
        seeded: told.seeded,
        artifact,
    };
    Ok(Outcome {
        result: JobResult::CreateKey(result),
        outputs: Vec::new(),
        key: Some(key),
        credentials: None,
    })
}
