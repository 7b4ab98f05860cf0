//! `verify` jobs: whose is this scene, or are these pictures?
use std::time::{Duration, Instant};

use guardsplat_proto::v1::complete_job_request::Result as Done;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{VerifyResult, VerifySpec};
use guardsplat_worker::extract::{MAX_PICTURES, find_source};
use guardsplat_worker::message::Key;

use super::attempt::Attempt;
use super::convert;
use super::error::{Error, Result};
use crate::work::findings::{Findings, read};

/// A reading that was compared.
struct Verified {
    findings: Findings,
    device: String,
    clip: String,
    duration: Duration,
}

/// Fetches suspects and key, reads and compares.
pub async fn carry_out(attempt: &mut Attempt<'_>, spec: &VerifySpec) -> Result<Done> {
    let views = convert::views(spec)?;
    if spec.suspects.is_empty() || spec.suspects.len() > MAX_PICTURES {
        let count = spec.suspects.len();
        return Err(Error::BadJob(format!(
            "suspects: {count} are outside 1 to {MAX_PICTURES}"
        )));
    }
    let names: Vec<&str> = spec.suspects.iter().map(String::as_str).collect();
    let paths = attempt.download(&names).await?;
    let key_file = attempt.download_key().await?;
    let (name, message) = (spec.key.clone(), spec.message.clone());
    let work = attempt.compute(move |bench, stop, reporter| {
        let start = Instant::now();
        let source = find_source(&paths)?;
        let key = Key::from_bytes(&name, &key_file)?;
        drop(key_file);
        // Nothing to compare with is no message of no bits.
        let message = Some(message).filter(|text| !text.is_empty());
        let message = message.map(|text| key.message(&text)).transpose()?;
        let device = bench.device().to_owned();
        let engine = bench.engine(&name, &key, stop)?;
        let (reading, ignored) = read(engine, &source, &views, |done, total| {
            reporter.tell(convert::stage(Stage::Reading, done, total));
        })?;
        let comparison = message.map(|message| reading.compare(&message)).transpose()?;
        Ok(Verified {
            findings: Findings::new(&reading, comparison.as_ref(), ignored.as_ref())?,
            device,
            clip: key.clip.name.clone(),
            duration: start.elapsed(),
        })
    });
    let verified = work.await?;
    Ok(Done::VerifyResult(VerifyResult {
        duration: convert::duration(verified.duration),
        device: verified.device,
        clip: verified.clip,
        ..convert::verify_result(verified.findings)
    }))
}
