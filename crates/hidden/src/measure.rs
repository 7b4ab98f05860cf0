//! How well a trained pair carries messages.
use burn::tensor::Tensor;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::decoder::Decoder;
use crate::error::{Result, host, within};
use crate::geometry::Geometry;
use crate::training::{Trained, accuracy, messages, next, strength};

/// Pictures at once.
const BATCH: usize = 8;

/// What was read from marked pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Share of right bits, 0 to 1.
    pub accuracy: f64,
    /// Mean over the pictures of the PSNR between marked and unmarked, in dB, after the clamp.
    pub psnr: f64,
}

impl Trained {
    /// Marks at least `count` pictures from `pictures` (as in [`crate::train`]; they should be unseen) with random
    /// messages of `seed` at `psnr` dB, changes them by `geometry` and reads them.
    ///
    /// # Errors
    /// Those of `pictures`, [`crate::Error::OutOfRange`] for numbers outside their limits.
    pub fn measure(
        &self,
        mut pictures: impl FnMut(usize) -> Result<Tensor<4>>,
        count: usize,
        psnr: f32,
        geometry: &Geometry,
        seed: u64,
    ) -> Result<Measured> {
        within("psnr", psnr.into(), 10.0, 60.0)?;
        within("pictures", count as f64, 1.0, 1e6)?;
        geometry.check()?;
        let decoder = Decoder::new(&self.weights, &self.device);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let batches = count.div_ceil(BATCH);
        let mut sum = Measured {
            accuracy: 0.0,
            psnr: 0.0,
        };
        for _ in 0..batches {
            let clean = next(&mut pictures, BATCH, &self.device)?;
            let messages = messages(BATCH, self.weights.bits(), &mut rng, &self.device);
            let marked = self.encoder.forward(clean.clone(), messages.clone(), strength(psnr));
            let [b, c, h, w] = clean.dims();
            let errors: Tensor<2> = (marked.clone() - clean).square().reshape([b, c * h * w]).mean_dim(1);
            let decibels = host(errors)?
                .into_iter()
                .map(|e| -10.0 * f64::from(e.max(1e-12)).log10());
            sum.psnr += decibels.sum::<f64>() / BATCH as f64;
            sum.accuracy += accuracy(decoder.forward(geometry.apply(marked, &mut rng)), messages)?;
        }
        Ok(Measured {
            accuracy: sum.accuracy / batches as f64,
            psnr: sum.psnr / batches as f64,
        })
    }
}
