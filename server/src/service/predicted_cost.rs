//! What a job will take of a worker's time, as far as its request tells: pixels of the views that are drawn and read. A
//! request of a few bytes must not keep a worker for days.
use guardsplat_proto::v1::embed_spec::Preset;
use guardsplat_proto::v1::{EmbedSpec, VerifySpec};

use crate::error::Result;
use crate::ledger::JobSpec;
use crate::service::violations::Violations;

/// Side of views where a request names none: of the largest CLIPs that are common. The server knows none.
const SIDE: u64 = 336;
/// Views of a scene that is verified, where a request names no number.
const VIEWS: u64 = 20;
/// Pixels of views that are drawn of an original to find from where a picture was taken, and most pictures that this is
/// done for (`crates/engine/src/extract/registration/mod.rs`, `crates/operations/src/registered.rs`).
const REGISTRATION: u64 = 250_000_000;
const REGISTERED: u64 = 16;
/// What a pixel is counted in.
const GIGA: u64 = 1_000_000_000;

/// Refuses a job that would draw more than `limit` billions of pixels; 0 is no limit.
pub fn check(spec: &JobSpec, limit: u64) -> Result<()> {
    let (fields, pixels): (&[&str], _) = match spec {
        JobSpec::Embed(spec) => (&["job.embed.size"], of_embed(spec)),
        JobSpec::Verify(spec) => (
            &["job.verify.suspects", "job.verify.views", "job.verify.size"],
            of_verify(spec),
        ),
        JobSpec::CreateKey(_) => return Ok(()),
    };
    if limit == 0 || pixels <= limit.saturating_mul(GIGA) {
        return Ok(());
    }
    let mut problems = Violations::default();
    for field in fields {
        problems.add(
            *field,
            format!(
                "asks for up to {} billion pixels of views, the limit is {limit}",
                pixels.div_ceil(GIGA)
            ),
        );
    }
    problems.finish()
}

/// Pixels that an embedding draws at most: the steps of its preset, as often as it may take more of them, twice that in
/// rooms, each of so many views. The engine's presets have the numbers (`crates/engine/src/embed/preset.rs`), and the server
/// knows nothing of the engine.
fn of_embed(spec: &EmbedSpec) -> u64 {
    let views = match spec.preset() {
        Preset::Unspecified | Preset::Standard => 240 * 4 * 2 * 8,
        Preset::Draft => 80 * 2 * 8,
        Preset::Robust => 320 * 4 * 2 * 8,
        Preset::Thorough => 480 * 2 * 2 * 8,
        Preset::Paper => 1300 * 16,
    };
    views * square(spec.size)
}

/// Pixels that a verification draws if all suspects are scenes, and if those that may be pictures are compared with an
/// original besides: which of both they are only their content tells.
fn of_verify(spec: &VerifySpec) -> u64 {
    let views = match spec.views {
        0 => VIEWS,
        views => views.into(),
    };
    let suspects = spec.suspects.len() as u64;
    let registered = match spec.original.is_empty() {
        true => 0,
        false => suspects.min(REGISTERED),
    };
    views
        .saturating_mul(suspects)
        .saturating_mul(square(spec.size))
        .saturating_add(registered * REGISTRATION)
}

fn square(side: u32) -> u64 {
    let side = match side {
        0 => SIDE,
        side => side.into(),
    };
    side * side
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verify(suspects: usize, views: u32, size: u32) -> Result<(), String> {
        let spec = VerifySpec {
            suspects: vec![String::new(); suspects],
            views,
            size,
            ..VerifySpec::default()
        };
        check(&JobSpec::Verify(spec), 16).map_err(|error| error.to_string())
    }

    fn embed(preset: Preset, size: u32) -> Result<()> {
        let spec = EmbedSpec {
            preset: preset.into(),
            size,
            ..EmbedSpec::default()
        };
        check(&JobSpec::Embed(spec), 16)
    }

    #[test]
    fn what_people_ask_for_is_taken() {
        verify(1, 0, 0).unwrap();
        verify(1, 900, 4096).unwrap();
        // A thousand pictures, whatever they are.
        verify(1000, 0, 0).unwrap();
        verify(1000, 20, 800).unwrap();
        for preset in [
            Preset::Draft,
            Preset::Standard,
            Preset::Robust,
            Preset::Thorough,
            Preset::Paper,
        ] {
            embed(preset, 0).unwrap();
            embed(preset, 800).unwrap();
        }
    }

    #[test]
    fn a_job_without_end_is_refused_with_the_numbers() {
        let told = verify(1000, 10_000, 4096).unwrap_err();
        assert!(told.contains("167773 billion pixels"), "{told}");
        assert!(told.contains("the limit is 16"), "{told}");
        assert!(verify(1, 960, 4096).is_err());
        embed(Preset::Paper, 4096).unwrap_err();
        let spec = VerifySpec {
            suspects: vec![String::new(); 1000],
            views: u32::MAX,
            size: u32::MAX,
            ..VerifySpec::default()
        };
        let spec = JobSpec::Verify(spec);
        assert!(check(&spec, 16).is_err(), "products do not wrap");
        check(&spec, 0).unwrap();
    }
}
