//! Random numbers of one step on one picture.
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::kind::AttackKind;

/// What random numbers are for. Each use has a stream, so that a range and the number drawn from it place alike.
#[derive(Clone, Copy)]
pub(super) enum RandomStream {
    /// Strength from a range.
    Strength = 0,
    /// Noise and places.
    Pixels = 1,
}

/// Where random numbers of one step on one picture come from.
///
/// They depend on what the step is and on how many of its kind came before, not on its position: a place or a strength
/// stays the same when a codec is put before it, which makes chains comparable, and noise added twice differs.
#[derive(Clone, Copy)]
pub(super) struct RandomSource {
    pub seed: u64,
    pub index: u64,
    pub kind: AttackKind,
    pub occurrence: u16,
}

impl RandomSource {
    /// The stream of one use.
    pub fn random(self, purpose: RandomStream) -> ChaCha8Rng {
        // seed, index and occurrence in little endian, then the name, padded with zeros: no two sources share a key.
        let bytes = self.seed.to_le_bytes().into_iter();
        let bytes = bytes.chain(self.index.to_le_bytes());
        let bytes = bytes.chain(self.occurrence.to_le_bytes());
        let bytes = bytes.chain(self.kind.name().bytes());
        let mut key = [0; 32];
        key.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
        let mut random = ChaCha8Rng::from_seed(key);
        random.set_stream(purpose as u64);
        random
    }
}

/// A ratio of sides from `1 / limit` to `limit`, its logarithm uniform.
pub(super) fn ratio(random: &mut ChaCha8Rng, limit: f64) -> f64 {
    let log = limit.ln();
    random.random_range(-log..=log).exp()
}

/// A whole number of `0..=most`, the same on machines of every word size.
pub(super) fn up_to(random: &mut ChaCha8Rng, most: u32) -> u32 {
    random.random_range(0..=most)
}
