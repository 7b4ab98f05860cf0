//! `create_key` jobs: the key file goes to the server as a secret, and is never on this machine's disk.
use std::time::{Duration, Instant};

use guardsplat_distortion::RobustTo;
use guardsplat_engine::clip::ShippedClip;
use guardsplat_engine::message::{Key, KeyOptions, TrainingOptions};
use guardsplat_proto::v1::complete_job_request::Result as Done;
use guardsplat_proto::v1::{KeyOutput, KeyResult, KeySpec};

use super::attempt::{Attempt, Outcome};
use super::convert;
use super::error::Result;
use super::transfer::Content;
use guardsplat_operations::create_key::{self, ProjectionOverrides};
use guardsplat_operations::load;

/// A key, before it is stored.
struct Made {
    key: Key,
    file: Vec<u8>,
    device: String,
    duration: Duration,
}

/// Makes the key and stores it.
pub async fn carry_out(attempt: &mut Attempt<'_>, spec: &KeySpec) -> Result<Outcome> {
    let options = KeyOptions {
        bits: spec.bits as usize,
        coded: true,
        bits_per_token: None,
        seed: spec.seed,
        robust_to: RobustTo::none(),
        training: TrainingOptions::default(),
    };
    let work = attempt.compute(move |cache, stop, reporter| {
        let start = Instant::now();
        let compute = cache.compute(ShippedClip::NEWEST, load::Work::Reading)?;
        let key = create_key::create(
            &options,
            ProjectionOverrides::default(),
            None,
            &compute,
            stop,
            |progress| {
                reporter.tell(convert::key_progress(progress));
            },
        )?;
        Ok(Made {
            file: key.to_bytes()?,
            key,
            device: compute.name.clone(),
            duration: start.elapsed(),
        })
    });
    let made = work.await?;
    let key_file = attempt
        .upload("guardsplat.key", Content::Bytes(made.file), true)
        .await?;
    let result = Done::KeyOutput(KeyOutput {
        key_file,
        key: Some(convert::key(&made.key)),
        result: Some(KeyResult {
            key: String::new(),
            bit_accuracy_unseen: made.key.accuracy_unseen,
            bit_accuracy_unseen_noisy: made.key.accuracy_unseen_noisy,
            duration: convert::duration(made.duration),
            device: made.device,
        }),
    });
    Ok(result.into())
}
