//! Seeds of keys, from which all of a key follows: sealed before they are kept, and opened for the worker alone.
use guardsplat_proto::v1::KeySpec;
use secrecy::ExposeSecret;

use crate::error::{Error, Result};
use crate::ledger::{JobId, KeyOrder, Ledger, Seed};
use crate::secrets::{self, MasterKey};

/// What the fingerprints of requests with a seed are for, so that they are those of nothing else.
const FINGERPRINT: &str = "request with a seed";

/// The order with its seed sealed for its job.
///
/// # Errors
/// `NoRandomness`, `SealFailed`.
pub(crate) fn sealed(master: &MasterKey, job: JobId, order: KeyOrder) -> Result<KeyOrder> {
    let seed = match order.seed {
        Some(Seed::Open(seed)) => Some(Seed::Sealed(master.seal(&place(job), &seed.to_be_bytes())?)),
        kept => kept,
    };
    Ok(KeyOrder { seed, ..order })
}

/// What the worker is told, who alone is told the seed.
///
/// # Errors
/// As [`MasterKey::open`]; `Internal` when what was sealed is no seed.
pub(crate) fn opened(master: &MasterKey, job: JobId, order: &KeyOrder) -> Result<KeySpec> {
    let seed = match &order.seed {
        None => None,
        Some(Seed::Open(seed)) => Some(*seed),
        Some(Seed::Sealed(sealed)) => {
            let bytes = master.open(&place(job), sealed)?;
            let bytes =
                <[u8; 8]>::try_from(bytes.expose_secret()).map_err(|error| Error::internal("opening a seed", error))?;
            Some(u64::from_be_bytes(bytes))
        }
    };
    Ok(KeySpec {
        bits: order.bits,
        seed,
        seeded: seed.is_some(),
    })
}

/// By what a request with a seed is known when it is sent again. A plain hash would let seeds be tried out on it.
pub(crate) fn fingerprint(master: &MasterKey, plain: [u8; 32]) -> [u8; 32] {
    master.keyed_hash(FINGERPRINT, &plain)
}

/// Seals the seeds that versions of before kept as they were told. How many there were.
///
/// # Errors
/// Those of the ledger and of sealing.
pub(crate) async fn seal_all(ledger: &dyn Ledger, master: &MasterKey) -> Result<usize> {
    let open = ledger.open_seeds().await?;
    let count = open.len();
    for (job, order) in open {
        let order = sealed(master, job, order)?;
        // Of the request nothing is left to make a keyed fingerprint of: sent again, it is refused as another one.
        let fingerprint = secrets::random::<32>()?;
        ledger.seal_seed(job, order, *fingerprint.expose_secret()).await?;
    }
    if count > 0 {
        tracing::info!(
            count,
            "seeds of keys were sealed; backups of before have them as they were told"
        );
    }
    Ok(count)
}

/// What the seed of a job is sealed for.
fn place(job: JobId) -> String {
    format!("jobs/{job}/seed")
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn seeds_open_for_their_job_only() {
        let (master, job) = (MasterKey::generate().unwrap(), Uuid::now_v7());
        let order = |seed| KeyOrder { bits: 64, seed };
        let kept = sealed(&master, job, order(Some(Seed::Open(7)))).unwrap();
        assert!(matches!(kept.seed, Some(Seed::Sealed(_))));
        assert_eq!(sealed(&master, job, kept.clone()).unwrap(), kept);
        let spec = opened(&master, job, &kept).unwrap();
        assert_eq!((spec.bits, spec.seed, spec.seeded), (64, Some(7), true));
        assert!(opened(&master, Uuid::now_v7(), &kept).is_err());
        assert!(opened(&MasterKey::generate().unwrap(), job, &kept).is_err());
        let none = sealed(&master, job, order(None)).unwrap();
        let spec = opened(&master, job, &none).unwrap();
        assert_eq!((spec.seed, spec.seeded), (None, false));
        let other = MasterKey::generate().unwrap();
        assert_ne!(fingerprint(&master, [1; 32]), fingerprint(&other, [1; 32]));
        assert_eq!(fingerprint(&master, [1; 32]), fingerprint(&master, [1; 32]));
    }
}
