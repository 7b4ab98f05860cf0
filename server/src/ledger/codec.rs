//! Specs, progress and results as the database holds them: encoded messages of the API, without which of them it is,
//! which the job's kind says.
use prost::Message;

use super::types::JobKind;
use super::work::{JobResult, JobSpec, Progress};
use super::{LedgerError, Result};

pub(super) fn encode_spec(spec: &JobSpec) -> Vec<u8> {
    match spec {
        JobSpec::Embed(spec) => spec.encode_to_vec(),
        JobSpec::Verify(spec) => spec.encode_to_vec(),
        JobSpec::CreateKey(spec) => spec.encode_to_vec(),
    }
}

pub(super) fn decode_spec(kind: JobKind, bytes: &[u8]) -> Result<JobSpec> {
    match kind {
        JobKind::Embed => decode("spec", bytes).map(JobSpec::Embed),
        JobKind::Verify => decode("spec", bytes).map(JobSpec::Verify),
        JobKind::CreateKey => decode("spec", bytes).map(JobSpec::CreateKey),
    }
}

pub(super) fn encode_result(result: &JobResult) -> Vec<u8> {
    match result {
        JobResult::Embed(result) => result.encode_to_vec(),
        JobResult::Verify(result) => result.encode_to_vec(),
        JobResult::CreateKey(result) => result.encode_to_vec(),
    }
}

pub(super) fn decode_result(kind: JobKind, bytes: &[u8]) -> Result<JobResult> {
    match kind {
        JobKind::Embed => decode("result", bytes).map(JobResult::Embed),
        JobKind::Verify => decode("result", bytes).map(JobResult::Verify),
        JobKind::CreateKey => decode("result", bytes).map(JobResult::CreateKey),
    }
}

pub(super) fn encode_progress(progress: &Progress) -> Vec<u8> {
    progress.encode_to_vec()
}

pub(super) fn decode_progress(bytes: &[u8]) -> Result<Progress> {
    decode("progress", bytes)
}

fn decode<M: Message + Default>(what: &'static str, bytes: &[u8]) -> Result<M> {
    M::decode(bytes).map_err(|source| LedgerError::Undecodable { what, source })
}

#[cfg(test)]
mod tests {
    use guardsplat_proto::v1;

    use super::*;

    #[test]
    fn what_is_kept_is_the_message_of_the_kind() {
        let spec = v1::VerifySpec {
            suspects: vec!["artifacts/7".into()],
            search: true,
            ..v1::VerifySpec::default()
        };
        let kept = encode_spec(&JobSpec::Verify(spec.clone()));
        assert_eq!(kept, spec.encode_to_vec());
        assert_eq!(decode_spec(JobKind::Verify, &kept).unwrap(), JobSpec::Verify(spec));
        let result = v1::KeyResult {
            key: "keys/7".into(),
            ..v1::KeyResult::default()
        };
        let kept = encode_result(&JobResult::CreateKey(result.clone()));
        assert_eq!(kept, result.encode_to_vec());
        assert_eq!(
            decode_result(JobKind::CreateKey, &kept).unwrap(),
            JobResult::CreateKey(result)
        );
        let wrong = decode_progress(&[255]);
        assert!(matches!(wrong, Err(LedgerError::Undecodable { what: "progress", .. })));
    }
}
