//! How long a search through all assets of a key takes, but for comparing: reading them from SQLite, and opening their
//! nonces. `cargo run --release -p guardsplat-server --example bench_candidates [ASSETS]`, 10,000 unless said otherwise.
use std::error::Error;
use std::time::{Duration, Instant};

use futures::{StreamExt, TryStreamExt, stream};
use guardsplat_proto::v1::KeyResult;
use guardsplat_server::access::DEFAULT_PROJECT;
use guardsplat_server::ledger::{
    Completion, JobResult, JobSpec, KeyId, KeyOrder, Ledger, NewArtifact, NewAsset, NewJob, NewKey, NewOwner, Origin,
    Registry, ResourceRequirements, SqliteLedger, candidates,
};
use guardsplat_server::notary::{self, Notary};
use guardsplat_server::secrets::MasterKey;
use uuid::Uuid;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Registrations that wait for each other's commit.
const AT_ONCE: usize = 64;
/// How often the search is timed.
const RUNS: usize = 5;

#[tokio::main]
async fn main() -> Outcome<()> {
    let count: usize = std::env::args().nth(1).map_or(Ok(10_000), |text| text.parse())?;
    let folder = tempfile::TempDir::new()?;
    let ledger = SqliteLedger::open(&folder.path().join("ledger.sqlite")).await?;
    let master = MasterKey::generate()?;
    let notary = Notary::open(&ledger, &master, 0).await?;
    let key = make_key(&ledger).await?;
    let owner = NewOwner {
        id: Uuid::now_v7(),
        project: DEFAULT_PROJECT.into(),
        display_name: "studio".into(),
        request_id: None,
    };
    let owner = ledger.create_owner(owner, 0).await?.id;

    let (ledger, master) = (&ledger, &master);
    let start = Instant::now();
    let made = stream::iter(0..count).map(|_| async {
        let id = Uuid::now_v7();
        let nonce = notary::new_nonce(master, id)?;
        let new = NewAsset {
            id,
            project: DEFAULT_PROJECT.into(),
            commitment: Uuid::now_v7(),
            owner,
            display_name: "a robot".into(),
            sha256: [1; 32],
            artifact: None,
            key,
            sealed_nonce: nonce.sealed,
            nonce_hash: nonce.hash,
            request_id: None,
        };
        Outcome::Ok(ledger.create_asset(new, notary.signing_key(), 0).await?)
    });
    made.buffer_unordered(AT_ONCE)
        .try_for_each(|_| async { Ok(()) })
        .await?;
    let took = start.elapsed().as_secs_f64();
    println!(
        "{count} assets registered, {AT_ONCE} at once, in {took:.2} s: {:.3} ms each",
        took * 1e3 / count as f64
    );

    let (mut reading, mut opening) = (Vec::new(), Vec::new());
    for _ in 0..RUNS {
        let start = Instant::now();
        let all: Vec<_> = candidates::of_key(ledger, key).try_collect().await?;
        reading.push(start.elapsed());
        assert_eq!(all.len(), count);
        let start = Instant::now();
        for candidate in &all {
            notary::open_nonce(master, candidate.asset, &candidate.sealed_nonce)?;
        }
        opening.push(start.elapsed());
    }
    println!(
        "read: median {:.1} ms, worst {:.1} ms",
        median(&mut reading),
        worst(&reading)
    );
    println!(
        "nonces opened: median {:.1} ms, worst {:.1} ms",
        median(&mut opening),
        worst(&opening)
    );
    Ok(())
}

/// The middle of some times, which are sorted, in milliseconds.
fn median(times: &mut [Duration]) -> f64 {
    times.sort();
    times[times.len() / 2].as_secs_f64() * 1e3
}

fn worst(times: &[Duration]) -> f64 {
    times.iter().max().map_or(0.0, |time| time.as_secs_f64() * 1e3)
}

/// Has a job make a key, as a worker would.
async fn make_key(ledger: &dyn Ledger) -> Outcome<KeyId> {
    let job = NewJob {
        id: Uuid::now_v7(),
        project: DEFAULT_PROJECT.into(),
        display_name: "key".into(),
        spec: JobSpec::CreateKey(KeyOrder { bits: 64, seed: None }),
        inputs: Vec::new(),
        key: None,
        request_id: None,
        asked_id: None,
        fingerprint: [0; 32],
        max_attempts: 1,
        trace_parent: None,
        priority: 0,
        requirements: ResourceRequirements::default(),
    };
    let job = ledger.create_job(job, 0).await?.id;
    let lease = ledger
        .claim("bench", Duration::from_secs(60), 0)
        .await?
        .ok_or("no job")?;
    let artifact = NewArtifact {
        id: Uuid::now_v7(),
        display_name: String::new(),
        size: 1,
        sha256: "00".repeat(32),
        origin: Origin::Output {
            job,
            token: lease.token.clone(),
        },
        secret: true,
        evidence: false,
        path: "nowhere".into(),
    };
    let artifact = ledger.create_artifact(artifact, 0).await?.id;
    ledger.artifact_ready(artifact, Some(&lease.token), 0).await?;
    let key = NewKey {
        id: Uuid::now_v7(),
        display_name: "key".into(),
        bits: 64,
        clip: "clip".into(),
        clip_sha256: "00".repeat(32),
        seeded: false,
        artifact,
    };
    let id = key.id;
    let completion = Completion {
        result: JobResult::CreateKey(KeyResult::default()),
        outputs: Vec::new(),
        key: Some(key),
        credentials: None,
        fingerprint: [0; 32],
    };
    ledger.complete(job, &lease.token, completion, 0).await?;
    Ok(id)
}
