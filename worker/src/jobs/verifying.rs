//! `verify` jobs: whose is this scene, or are these pictures?
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use guardsplat_proto::v1::complete_job_request::Result as Done;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{VerifyResult, VerifySpec};
use guardsplat_worker::extract::{MAX_PICTURES, Source};
use guardsplat_worker::message::Key;

use super::attempt::Attempt;
use super::convert;
use super::error::{Error, Result};
use crate::work::findings::{Findings, read};

/// What every PLY begins with.
const PLY: &[u8] = b"ply";

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
    let source = source(paths)?;
    let key_file = attempt.download_key().await?;
    let (name, message) = (spec.key.clone(), spec.message.clone());
    let work = attempt.compute(move |bench, stop, reporter| {
        let start = Instant::now();
        let key = Key::from_bytes(&name, &key_file)?;
        drop(key_file);
        // Nothing to compare with is no message of no bits.
        let message = Some(message).filter(|text| !text.is_empty());
        let message = message.map(|text| key.message(&text)).transpose()?;
        let device = bench.device().to_owned();
        let engine = bench.engine(&name, &key, stop)?;
        let reading = read(engine, &source, &views, |done, total| {
            reporter.tell(convert::stage(Stage::Reading, done, total));
        })?;
        let comparison = message.map(|message| reading.compare(&message)).transpose()?;
        Ok(Verified {
            findings: Findings::new(&reading, comparison.as_ref())?,
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

/// What the files are, by their first bytes: artifacts need no extensions.
fn source(mut paths: Vec<PathBuf>) -> Result<Source> {
    let scenes = paths.iter().map(|path| is_scene(path)).collect::<Result<Vec<bool>>>()?;
    if !scenes.contains(&true) {
        return Ok(Source::Pictures(paths));
    }
    match paths.pop() {
        Some(scene) if paths.is_empty() => Ok(Source::Scene(scene)),
        _ => Err(Error::BadJob(
            "suspects: a scene is read on its own: give one scene, or pictures".into(),
        )),
    }
}

fn is_scene(path: &Path) -> Result<bool> {
    let mut start = Vec::new();
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    file.take(PLY.len() as u64)
        .read_to_end(&mut start)
        .map_err(Error::io(path))?;
    Ok(start == PLY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_scene_or_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let (scene, picture, empty) = (
            file("input-0", b"ply\nformat"),
            file("input-1", b"\x89PNG"),
            file("input-2", b""),
        );
        let of = |paths: &[&PathBuf]| source(paths.iter().map(|p| (*p).clone()).collect());
        assert_eq!(of(&[&scene]).unwrap(), Source::Scene(scene.clone()));
        assert_eq!(
            of(&[&picture, &empty]).unwrap(),
            Source::Pictures(vec![picture.clone(), empty])
        );
        for mixed in [[&scene, &picture], [&picture, &scene], [&scene, &scene]] {
            assert!(of(&mixed).unwrap_err().to_string().contains("on its own"));
        }
    }
}
