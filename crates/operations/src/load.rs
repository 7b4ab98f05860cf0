//! Loads what embedding and verifying need: cameras, what reads pictures, and the engine for a key, which loads the rest when
//! it is used.
use std::path::{Path, PathBuf};

use guardsplat_engine::clip::{Clip, Parts, ShippedClip};
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::extract::{Engine, HiddenExtractor};
use guardsplat_engine::memory::Limits;
use guardsplat_engine::message::{ClipIdentity, Decoding, Key};
use guardsplat_engine::models::{LPIPS, Models, WEIGHTS};
use guardsplat_engine::view::{Camera, read_cameras};
use guardsplat_engine::{Error, Result};

/// Cameras of a file or folder; none without one.
pub fn cameras(path: Option<&Path>) -> Result<Vec<Camera>> {
    Ok(path.map(read_cameras).transpose()?.unwrap_or_default())
}

/// What a device is wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Embedding: thousands of views of one scene.
    Marking,
    /// All else: keys are made, pictures and scenes read.
    Reading,
}

/// The device for such work with the CLIP called `clip`, where `choice` was made. Shipped CLIPs mark faster on a card, and
/// read faster on the CPU beside it (docs/performance.md), so `auto` takes a card, if there is one, for marking and for all
/// other CLIPs.
///
/// # Errors
/// Those of [`open`].
pub fn device(choice: DeviceChoice, clip: &str, work: Work) -> Result<Compute> {
    match choice {
        DeviceChoice::Auto if work == Work::Reading && ShippedClip::named(clip).is_some() => open(DeviceChoice::Cpu),
        _ => open(choice),
    }
}

/// The CLIP of that name: a shipped one, or one that was added.
pub fn clip(name: &str, compute: &Compute, parts: Parts) -> Result<(Clip, ClipIdentity)> {
    let clip = match ShippedClip::named(name) {
        Some(shipped) => shipped.load(&compute.device, parts)?,
        None => Clip::load(&Models::open()?.dir(name)?, &compute.device, parts)?,
    };
    let identity = ClipIdentity {
        name: name.to_owned(),
        hash: clip.hash.clone(),
    };
    Ok((clip, identity))
}

/// Where the weights of LPIPS are, if they were added.
fn lpips() -> Option<PathBuf> {
    // Without a data folder nothing was added.
    let folder = Models::open().ok()?.dir(LPIPS).ok()?;
    Some(folder.join(WEIGHTS))
}

/// An engine for a key on the [`device`] for its CLIP and for such work. The key must belong to the CLIP, if it reads with one: the one named,
/// else the one that the key names. `path` names the key in messages, and `budget` is how many bytes of memory a job may
/// take, if not all of the machine's.
pub fn engine(
    path: &Path,
    key: &Key,
    clip_name: Option<&str>,
    choice: DeviceChoice,
    work: Work,
    with_lpips: bool,
    budget: Option<u64>,
) -> Result<Engine> {
    let lpips = if with_lpips { lpips() } else { None };
    let compute = device(choice, clip_name.unwrap_or(&key.clip.name), work)?;
    let mut engine = match &key.decoding {
        Decoding::Clip { .. } => {
            let name = clip_name.unwrap_or(&key.clip.name);
            let (clip, identity) = clip(name, &compute, Parts::Image)?;
            key.require_clip(path, &identity)?;
            Engine::new(compute, clip, key, lpips)?
        }
        Decoding::Hidden(_) => {
            if let Some(name) = clip_name {
                return Err(Error::BadOption {
                    field: "clip",
                    reason: format!("the key reads pictures without a CLIP, so {name:?} has no use"),
                });
            }
            let extractor = HiddenExtractor::new(key, &compute.device)?;
            Engine::with_extractor(compute, Box::new(extractor), lpips)
        }
    };
    engine.limits = Limits {
        buffer: engine.limits.buffer,
        ..Limits::of_machine(budget)
    };
    Ok(engine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_reads_shipped_clips_on_the_cpu_and_gives_a_card_to_all_else() {
        let shipped = ShippedClip::NEWEST;
        let auto = |clip, work| device(DeviceChoice::Auto, clip, work).unwrap().name;
        assert_eq!(auto(shipped, Work::Reading), "cpu");
        let any = open(DeviceChoice::Auto).unwrap().name;
        assert_eq!(auto(shipped, Work::Marking), any);
        assert_eq!(auto("vit-b32", Work::Reading), any);
        // Who names a device gets it, or an error.
        let named = |clip| {
            device(DeviceChoice::Wgpu, clip, Work::Reading)
                .map(|compute| compute.name)
                .ok()
        };
        assert_eq!(named(shipped), named("vit-b32"));
    }
}
