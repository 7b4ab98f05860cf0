//! Makes a key for the CLIP of a name.
use guardsplat_codeword::{MessageCode, MessageLength};
use guardsplat_engine::Result;
use guardsplat_engine::clip::{Parts, ShippedClip};
use guardsplat_engine::device::Compute;
use guardsplat_engine::extract::rasterizer;
use guardsplat_engine::message::key::{KeyProgress, create_key, natural_images};
use guardsplat_engine::message::{DecoderKind, FitOptions, Key, KeyOptions};
use guardsplat_engine::stop::Stop;

use crate::load;

/// What the projection ignores and keeps of CLIP's features, where experiments ask for something else than usual.
#[derive(Clone, Copy, Default)]
pub struct ProjectionOverrides {
    /// What kind of decoder reads the message; unless given a linear one of a CLIP with ranked features, else a
    /// perceptron.
    pub decoder: Option<DecoderKind>,
    /// Directions of strongest natural variation to drop; 64 unless given, at most an eighth of all. None of a CLIP with
    /// ranked features.
    pub remove: Option<usize>,
    /// Dimensions to keep of the rest; unless given all, or of ranked features as many as the message takes.
    pub keep: Option<usize>,
}

/// Makes a key for the CLIP called `clip`, without a name for the newest shipped one. Messages are
/// coded where that is asked for and the shipped ones, or such as them, read them.
pub fn create(
    options: &KeyOptions,
    overrides: ProjectionOverrides,
    clip: Option<&str>,
    compute: &Compute,
    stop: &Stop,
    progress: impl FnMut(KeyProgress),
) -> Result<Key> {
    let name = clip.unwrap_or(ShippedClip::NEWEST);
    let (clip, identity) = load::clip(name, compute, Parts::Both)?;
    let ranked = clip.config.is_ranked();
    let kind = overrides.decoder.unwrap_or(match ranked {
        true => DecoderKind::Linear,
        false => DecoderKind::Perceptron,
    });
    let mut options = options.clone();
    options.training.kind = kind;
    // Of features that are not ranked it was never tried, and fewer dimensions than a word has bits would not tell them apart.
    let room = clip.dim() >= MessageLength::CODED.bits() as usize;
    options.coded &= ranked && room && kind == DecoderKind::Linear && MessageCode::is_for(options.bits);
    // A perceptron needs more dimensions than bits to tell texts apart; a linear decoder reads the strongest ones best.
    let ranked = ranked && kind == DecoderKind::Linear;
    let projection = FitOptions {
        remove: overrides
            .remove
            .unwrap_or(FitOptions::default().remove.min(clip.dim() / 8)),
        keep: overrides
            .keep
            .or(ranked.then(|| ranked_dimensions(options.word_bits(), clip.dim()))),
        ranked,
    };
    stop.check()?;
    let pictures = natural_images::pictures(rasterizer(compute)?, clip.config.vision.image_size as u32)?;
    create_key(&options, projection, &clip, identity, compute, pictures, stop, progress)
}

/// Dimensions of ranked features that a word of so many bits is read from: every further one is weaker than those
/// before it.
fn ranked_dimensions(bits: usize, width: usize) -> usize {
    bits.max(8).min(width)
}
