//! Specs, progress and results as the database holds them: encoded messages of the API, without which of them it is,
//! which the job's kind says. The order of a key is a message of its own.
use prost::Message;

use super::types::JobKind;
use super::work::{JobResult, JobSpec, KeyOrder, Progress, Seed};
use super::{LedgerError, Result};

pub(super) fn encode_spec(spec: &JobSpec) -> Vec<u8> {
    match spec {
        JobSpec::Embed(spec) => spec.encode_to_vec(),
        JobSpec::Verify(spec) => spec.encode_to_vec(),
        JobSpec::CreateKey(order) => KeptKeyOrder::from(order).encode_to_vec(),
    }
}

/// As `guardsplat.v1.KeySpec`, which was kept itself once, with the seed as it was told.
#[derive(Clone, PartialEq, Message)]
struct KeptKeyOrder {
    #[prost(uint32, tag = "1")]
    bits: u32,
    #[prost(uint64, optional, tag = "2")]
    open_seed: Option<u64>,
    #[prost(bytes = "vec", optional, tag = "15")]
    sealed_seed: Option<Vec<u8>>,
}

impl From<&KeyOrder> for KeptKeyOrder {
    fn from(order: &KeyOrder) -> Self {
        let (open_seed, sealed_seed) = match &order.seed {
            None => (None, None),
            Some(Seed::Open(seed)) => (Some(*seed), None),
            Some(Seed::Sealed(sealed)) => (None, Some(sealed.clone())),
        };
        Self {
            bits: order.bits,
            open_seed,
            sealed_seed,
        }
    }
}

impl From<KeptKeyOrder> for KeyOrder {
    fn from(kept: KeptKeyOrder) -> Self {
        let sealed = kept.sealed_seed.map(Seed::Sealed);
        Self {
            bits: kept.bits,
            seed: sealed.or(kept.open_seed.map(Seed::Open)),
        }
    }
}

pub(super) fn decode_spec(kind: JobKind, bytes: &[u8]) -> Result<JobSpec> {
    match kind {
        JobKind::Embed => decode("spec", bytes).map(JobSpec::Embed),
        JobKind::Verify => decode("spec", bytes).map(JobSpec::Verify),
        JobKind::CreateKey => decode("spec", bytes).map(|kept: KeptKeyOrder| JobSpec::CreateKey(kept.into())),
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
        // As it was kept before seeds were sealed, and as it is now.
        let before = v1::KeySpec {
            bits: 64,
            seed: Some(7),
            ..v1::KeySpec::default()
        };
        for seed in [Seed::Open(7), Seed::Sealed(vec![1, 2])] {
            let order = JobSpec::CreateKey(KeyOrder {
                bits: 64,
                seed: Some(seed.clone()),
            });
            let kept = encode_spec(&order);
            assert_eq!(kept == before.encode_to_vec(), seed == Seed::Open(7));
            assert_eq!(decode_spec(JobKind::CreateKey, &kept).unwrap(), order);
        }
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
