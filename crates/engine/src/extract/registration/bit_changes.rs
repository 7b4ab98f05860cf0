//! What each bit of a word asks of a scene's colours, as far as pictures show them: the first step of a mark.
use std::ops::Range;

use burn::tensor::{Tensor, TensorData};

use super::Original;
use crate::error::{Error, Result};
use crate::extract::{Engine, default_size, stands_for};
use crate::picture::Picture;
use crate::quality::{batch, unbatch};
use crate::splat::{Learnable, PreparedView, sh};
use crate::view::Split;

/// Views from which bits are looked at: twice as many take twice as long, a third of them reads a few bits less.
const VIEWS: u64 = 48;
/// Bits whose gradients are computed at once.
const AT_ONCE: usize = 16;
/// Smallest energy of a Gaussian that is believed, against the mean of all: as where marks are made.
const FLOOR: f32 = 1e-2;
/// Most numbers that are kept, of all bits: 256 MiB.
const MOST_NUMBERS: usize = 1 << 26;
/// Memory that the matched filter takes, bytes: these numbers, and half as much of what a picture shows of them.
pub const MATCHED_FILTER_BYTES: u64 = 6 * MOST_NUMBERS as u64;

/// For each bit a change of the colours of the Gaussians that pictures show.
pub(super) struct BitChanges {
    /// The Gaussians, of which three numbers are changed.
    learnable: Learnable,
    /// Red, green and blue of each slot, for each bit; the sum of their squares, each times what it shows, is 1.
    bits: Vec<Vec<f32>>,
}

impl BitChanges {
    /// The gradient of each logit to the colours, the mean over training views of the unmarked scene, over what a change costs
    /// in pictures (a Gaussian's weights times the cover of its pixels). `shown` says how much of each Gaussian the
    /// pictures show that are read; those that show least are left out where there are too many.
    ///
    /// # Errors
    /// A failing device, or [`Error::Stopped`].
    pub fn of(original: &Original<'_>, shown: &[f32]) -> Result<Self> {
        let engine = original.engine;
        let learnable = Learnable::new(&largest(shown, MOST_NUMBERS / (3 * engine.bits.max(1))), 0);
        let mut bits = vec![vec![0.0; learnable.len()]; engine.bits];
        let mut energies = vec![0.0; learnable.rows().len()];
        let side = default_size(engine);
        for index in 0..VIEWS {
            engine.stop.check()?;
            let camera = original.sampler.camera(Split::Training, index, side);
            let cache = engine.weight_cache(side, false);
            let view = original.geometry.prepare_averaged(&camera, stands_for(side), cache)?;
            let slots: Vec<Option<usize>> = view.visible.iter().map(|row| learnable.slot(*row)).collect();
            let rasterizer = engine.rasterizer()?;
            let picture = rasterizer.render(&view, &sh::colours(original.geometry.sh(), None, &view), [1.0; 3])?;
            for (slot, energy) in slots.iter().zip(energies_of(engine, &view)?) {
                slot.iter().for_each(|slot| energies[*slot] += energy);
            }
            for first in (0..engine.bits).step_by(AT_ONCE) {
                let these = first..engine.bits.min(first + AT_ONCE);
                let to_pictures = logit_gradients(engine, &picture, these.clone())?;
                let to_colours = engine.each(&to_pictures, |gradient| {
                    engine.rasterizer()?.backward(&view, &gradient.pixels)
                })?;
                for (sums, gradient) in bits[these].iter_mut().zip(&to_colours) {
                    let of_rows = slots.iter().zip(gradient.as_chunks::<3>().0);
                    for (slot, gradient) in of_rows.filter_map(|(slot, gradient)| Some(((*slot)?, gradient))) {
                        (0..3).for_each(|k| sums[3 * slot + k] += gradient[k]);
                    }
                }
            }
        }
        let mean = energies.iter().sum::<f32>() / energies.len().max(1) as f32;
        let least = (FLOOR * mean).max(f32::MIN_POSITIVE);
        energies.iter_mut().for_each(|energy| *energy = energy.max(least));
        for bit in &mut bits {
            let slots = bit.as_chunks_mut::<3>().0;
            let squares = slots.iter().zip(&energies);
            let squares = squares.map(|(change, energy)| change.iter().map(|v| f64::from(v * v / energy)).sum::<f64>());
            let length = squares.sum::<f64>().sqrt().max(f64::MIN_POSITIVE) as f32;
            for (change, energy) in slots.iter_mut().zip(&energies) {
                *change = change.map(|v| v / energy / length);
            }
        }
        Ok(Self { learnable, bits })
    }

    /// What a view shows of the change that each bit asks for, values that may be negative.
    ///
    /// # Errors
    /// A failing device, or [`Error::Stopped`].
    pub fn pictures(&self, engine: &Engine, view: &PreparedView) -> Result<Vec<Picture>> {
        engine.each(&self.bits, |bit| {
            let colour = |row: &u32| {
                self.learnable
                    .slot(*row)
                    .map_or([0.0; 3], |slot| bit.as_chunks().0[slot])
            };
            let colours: Vec<f32> = view.visible.iter().flat_map(colour).collect();
            engine.rasterizer()?.render(view, &colours, [0.0; 3])
        })
    }
}

/// Of each visible Gaussian of a view the sum over pixels of its weight times the cover of the pixel.
///
/// # Errors
/// A failing device.
pub(super) fn energies_of(engine: &Engine, view: &PreparedView) -> Result<Vec<f32>> {
    let rasterizer = engine.rasterizer()?;
    let cover = rasterizer.render(view, &vec![1.0; 3 * view.visible.len()], [0.0; 3])?;
    let energies = rasterizer.backward(view, &cover.pixels)?;
    Ok(energies.as_chunks::<3>().0.iter().map(|energy| energy[0]).collect())
}

/// Gradients of these logits of a picture to its pixels.
fn logit_gradients(engine: &Engine, picture: &Picture, bits: Range<usize>) -> Result<Vec<Picture>> {
    let device = engine.compute.device.clone().autodiff();
    let leaf = batch(&vec![picture; bits.len()], &device)?.require_grad();
    let logits = engine.logits(leaf.clone())?;
    // A copy of the picture for each bit, so that one pass back is enough.
    let mut chosen = vec![0.0_f32; bits.len() * engine.bits];
    for (copy, bit) in bits.clone().enumerate() {
        chosen[copy * engine.bits + bit] = 1.0;
    }
    let chosen = Tensor::<2>::from_data(TensorData::new(chosen, [bits.len(), engine.bits]), &device);
    let gradients = (logits * chosen).sum().backward();
    let gradient = leaf.grad(&gradients).ok_or_else(|| Error::Device {
        device: engine.compute.name.clone(),
        reason: "logits have no gradient to pictures".into(),
    })?;
    unbatch(gradient)
}

/// Which numbers above 0 are among the `most` largest.
fn largest(numbers: &[f32], most: usize) -> Vec<bool> {
    let mut ordered: Vec<u32> = (0..numbers.len() as u32)
        .filter(|i| numbers[*i as usize] > 0.0)
        .collect();
    if ordered.len() > most {
        // Of equal ones the first, so that there are never more.
        let by_size = |a: &u32, b: &u32| numbers[*b as usize].total_cmp(&numbers[*a as usize]).then(a.cmp(b));
        ordered.select_nth_unstable_by(most, by_size);
        ordered.truncate(most);
    }
    let mut chosen = vec![false; numbers.len()];
    ordered.into_iter().for_each(|i| chosen[i as usize] = true);
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_are_chosen_and_nothing_that_is_not_seen() {
        let numbers = [0.0, 3.0, 1.0, 3.0, f32::MIN_POSITIVE, 0.0];
        let chosen = |most| -> Vec<usize> { (0..6).filter(|i| largest(&numbers, most)[*i]).collect() };
        assert_eq!(chosen(9), [1, 2, 3, 4]);
        assert_eq!(chosen(3), [1, 2, 3]);
        assert_eq!((chosen(1), chosen(0)), (vec![1], vec![]));
    }
}
