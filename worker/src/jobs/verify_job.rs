//! `verify` jobs: whose is this scene, or are these pictures?
use std::time::{Duration, Instant};

use guardsplat_engine::extract::{MAX_PICTURES, find_source};
use guardsplat_engine::message::Key;
use guardsplat_proto::v1::complete_job_request::Result as Done;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{FramedReading, SeenView, VerifyResult, VerifySpec};

use super::attempt::{Attempt, Outcome};
use super::convert;
use super::error::{Error, Result};
use guardsplat_operations::comparison::read_and_compare;
use guardsplat_operations::load;
use guardsplat_operations::registered::{AllReadings, read_all};
use guardsplat_operations::suspect::Suspect;
use guardsplat_operations::thumbnails::Thumbnails;
use guardsplat_operations::verification_report::VerificationReport;

/// A reading that was compared, or is for the server to decide on.
struct Verified {
    findings: VerificationReport,
    readings: Vec<FramedReading>,
    shown: Thumbnails,
    device: String,
    clip: String,
    duration: Duration,
}

/// Fetches suspects and key, reads and compares.
pub async fn carry_out(attempt: &mut Attempt<'_>, spec: &VerifySpec) -> Result<Outcome> {
    let mut views = convert::views(spec)?;
    if spec.suspects.is_empty() || spec.suspects.len() > MAX_PICTURES {
        let count = spec.suspects.len();
        return Err(Error::BadJob(format!(
            "suspects: {count} are outside 1 to {MAX_PICTURES}"
        )));
    }
    let others = [&spec.cameras, &spec.original];
    let others_given = others.iter().filter(|name| !name.is_empty());
    let names: Vec<&str> = spec
        .suspects
        .iter()
        .chain(others_given.copied())
        .map(String::as_str)
        .collect();
    let inputs = attempt.download(&names).await?;
    let mut paths: Vec<_> = inputs.into_iter().map(|input| input.path).collect();
    let mut others_found = paths.split_off(spec.suspects.len()).into_iter();
    let [cameras_file, original] = others.map(|name| (!name.is_empty()).then(|| others_found.next()).flatten());
    let key_file = attempt.download_key().await?;
    let (name, message) = (spec.key.clone(), spec.message.clone());
    let claim = !spec.asset.is_empty() || !spec.owner.is_empty() || spec.search;
    let rate = attempt.lease.false_positive_rate;
    let work = attempt.compute(move |cache, stop, reporter| {
        let start = Instant::now();
        views.cameras = load::cameras(cameras_file.as_deref())?;
        let suspect: Suspect = find_source(&paths)?.into();
        let key = Key::from_bytes(&name, &key_file)?;
        drop(key_file);
        // Nothing to compare with is no message of no bits.
        let message = Some(message).filter(|text| !text.is_empty());
        let message = message.map(|text| key.message(&text)).transpose()?;
        let engine = cache.engine(&name, &key, load::Work::Reading, rate, stop)?;
        let device = engine.compute.name.clone();
        let progress = |done, total| reporter.tell(convert::stage(Stage::Reading, done, total));
        let mut shown = Thumbnails::default();
        let (findings, framed) = if claim {
            let AllReadings {
                of_hypotheses: read,
                explained,
            } = read_all(engine, &suspect, &views, original.as_deref(), &mut shown, progress)?;
            for (picture, estimate) in read.estimates.iter().enumerate() {
                tracing::info!(picture, estimate, "estimated what was done to a picture");
            }
            // As given comes first.
            let reading = read.readings.first().map(|(_, reading)| reading);
            let reading = reading.ok_or_else(|| Error::BadJob("suspects: nothing was read".into()))?;
            let mut findings = VerificationReport::new(&engine.message_code, reading, None, &read.ignored)?;
            findings.explained_by_original = explained;
            (findings, read.readings)
        } else {
            let compared = read_and_compare(
                engine,
                &suspect,
                &views,
                original.as_deref(),
                message.as_ref(),
                progress,
            )?;
            (VerificationReport::of(&engine.message_code, &compared)?, Vec::new())
        };
        Ok(Verified {
            findings,
            // Of a raw message all is said in the findings.
            readings: framed
                .iter()
                .map(|(hypothesis, logits)| convert::framed_reading(*hypothesis, logits))
                .collect(),
            shown,
            device,
            clip: key.clip.name.clone(),
            duration: start.elapsed(),
        })
    });
    let verified = work.await?;
    let result = Done::VerifyResult(VerifyResult {
        duration: convert::duration(verified.duration),
        device: verified.device,
        clip: verified.clip,
        ..convert::verify_result(verified.findings)
    });
    let view = |(name, read)| SeenView {
        name,
        read,
        original: Vec::new(),
    };
    Ok(Outcome {
        result,
        readings: verified.readings,
        views: verified.shown.0.into_iter().map(view).collect(),
    })
}
