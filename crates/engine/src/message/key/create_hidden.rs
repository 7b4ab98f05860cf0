//! Makes a key whose messages a convolutional decoder reads, which is trained for that key alone.
use guardsplat_distortion::{Layer, RobustTo};
use guardsplat_hidden::{Geometry, Options, Synthetic, Trained, train};
use sha2::{Digest, Sha256};

use super::{ClipIdentity, Decoding, Key, Secret};
use crate::device::Compute;
use crate::error::Result;
use crate::message::tokens::fewest_bits_per_token;
use crate::stop::Stop;
use guardsplat_codeword::MessageLength;

/// What keys name in place of a CLIP.
pub const HIDDEN: &str = "hidden";
/// Side of the pictures of the training, in pixels: textures count, not the size of what is shown.
const SIDE: usize = 48;
/// Pictures that the decoder is measured on, and how strong their marks are.
const MEASURED: usize = 64;
const MEASURED_PSNR: f32 = 37.0;

/// What such a key is made from.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenKeyOptions {
    /// Bits of its messages, 1 to [`guardsplat_hidden::MAX_BITS`].
    pub bits: usize,
    /// Makes the key reproducible, and only as secret as the seed; `None` asks the operating system for a secret.
    pub seed: Option<u64>,
    /// Steps of the training; `None` takes [`Options::default`]'s.
    pub steps: Option<usize>,
    /// Distortions of pictures that the decoder is to stand.
    pub robust_to: RobustTo,
}

impl HiddenKeyOptions {
    fn training(&self, seed: u64) -> Options {
        let defaults = Options::default();
        Options {
            bits: self.bits,
            steps: self.steps.unwrap_or(defaults.steps),
            distortions: Layer {
                robust_to: self.robust_to,
                ..Layer::default()
            },
            seed,
            ..defaults
        }
    }

    /// SHA-256 of how the decoder is made, but for its bits and seed, in hexadecimal: what a key has in place of the hash of
    /// a CLIP, and reports tell decoders apart by.
    pub fn recipe(&self) -> String {
        let alike = Options {
            bits: 0,
            ..self.training(0)
        };
        hex::encode(Sha256::digest(format!("guardsplat-hidden 1, {SIDE} px, {alike:?}")))
    }
}

/// Makes a key: draws or derives the secret, and trains its decoder on synthetic pictures. `progress` hears of steps taken,
/// of so many. On the CPU the same seed gives the same key.
///
/// # Errors
/// Numbers outside their limits, a loss that stops being a number, a failing device,
/// [`Error::Stopped`](crate::Error::Stopped).
pub fn create_hidden_key(
    options: &HiddenKeyOptions,
    compute: &Compute,
    stop: &Stop,
    mut progress: impl FnMut(usize, usize),
) -> Result<Key> {
    MessageLength::new(options.bits)?;
    let secret = Secret::draw(options.seed)?;
    // Weights and pictures follow from the secret: who has not the key has not the decoder.
    let seed = secret.derived_seed(b"guardsplat hidden decoder seed v1");
    let training = options.training(seed);
    let device = &compute.device.clone().without_autodiff();
    let mut pictures = Synthetic::new(SIDE, seed)?;
    let trained = train(
        &training,
        device,
        |count| Ok(pictures.next(count, device)),
        |p| progress(p.step, p.steps),
        || stop.check().is_err(),
    )?;
    let measure = |geometry: Geometry| read_unseen(&trained, &geometry, seed, compute);
    Ok(Key {
        secret,
        seed: options.seed,
        coded_bits: None,
        bits_per_token: fewest_bits_per_token(options.bits),
        clip: ClipIdentity {
            name: HIDDEN.into(),
            hash: options.recipe(),
        },
        accuracy_unseen: Some(measure(Geometry::NONE)?),
        accuracy_unseen_noisy: Some(measure(Geometry::default())?),
        decoding: Decoding::Hidden(trained.weights),
    })
}

/// Share of right bits in pictures that training has not seen, marked by its encoder.
fn read_unseen(trained: &Trained, geometry: &Geometry, seed: u64, compute: &Compute) -> Result<f64> {
    let device = &compute.device.clone().without_autodiff();
    let mut unseen = Synthetic::new(SIDE, seed.wrapping_add(1))?;
    let next = |count| Ok(unseen.next(count, device));
    Ok(trained.measure(next, MEASURED, MEASURED_PSNR, geometry, seed)?.accuracy)
}
