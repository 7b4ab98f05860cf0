//! Mean sines on burn's CPU device.
use std::ops::Range;

use burn::backend::{Flex, TensorMetadata};
use burn::tensor::{Shape, TensorData};

use super::cpu::{QUARTER, gradients, means, waves};
use super::density;
use super::pool::Squares;
use super::{FloatTensor, MeanSines, WeightedSines};
use crate::simd::Instructions;

/// What the backward pass needs.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    pictures: FloatTensor<Flex>,
    filters: FloatTensor<Flex>,
    phases: FloatTensor<Flex>,
    scales: Vec<Scale>,
}

#[derive(Clone, Debug)]
struct Scale {
    squares: Squares,
    /// Weights `[b][pixels]` of squares; none where all weigh alike.
    weights: Option<Vec<f32>>,
    /// Its waves among those of all scales.
    waves: Range<usize>,
}

impl MeanSines for Flex {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        sides: Vec<usize>,
        equalization: f32,
    ) -> FloatTensor<Self> {
        Self::means(pictures, filters, phases, sides, equalization).0
    }
}

impl WeightedSines for Flex {
    type Kept = Kept;

    fn means(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        sides: Vec<usize>,
        equalization: f32,
    ) -> (FloatTensor<Self>, Kept) {
        let (views, all) = (pictures.shape()[0], phases.shape()[0]);
        let [pictures, filters, phases] = [pictures, filters, phases].map(|t| t.to_contiguous());
        let waves = waves(filters.storage(), phases.storage(), 0.0);
        let of_scale = all / sides.len().max(1);
        let (mut out, mut scales) = (vec![0.0; views * all], Vec::with_capacity(sides.len()));
        for (scale, side) in sides.into_iter().enumerate() {
            let (squares, own) = (squares(&pictures, side), scale * of_scale..(scale + 1) * of_scale);
            let of_squares = squares.means(pictures.storage());
            let weighted = equalization != 0.0;
            let weights = weighted.then(|| density::weights(Instructions::widest(), &of_squares, views, equalization));
            let means = means(
                Instructions::widest(),
                &of_squares,
                views,
                &waves[own.clone()],
                weights.as_deref(),
            );
            for (out, means) in out.chunks_mut(all.max(1)).zip(means.chunks(of_scale.max(1))) {
                out[own.clone()].copy_from_slice(means);
            }
            scales.push(Scale {
                squares,
                weights,
                waves: own,
            });
        }
        let out = TensorData::new(out, Shape::new([views, all]));
        let kept = Kept {
            pictures,
            filters,
            phases,
            scales,
        };
        (FloatTensor::<Self>::from_data(out), kept)
    }

    fn means_backward(kept: Kept, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        let (shape, gradient) = (kept.pictures.shape(), gradient.to_contiguous());
        let (filters, gradient): (&[f32], &[f32]) = (kept.filters.storage(), gradient.storage());
        let waves = waves(filters, kept.phases.storage(), QUARTER);
        let of_scale = |scale: &Scale| {
            let own = &scale.waves;
            let of_views = gradient.chunks(waves.len().max(1));
            let gradient: Vec<f32> = of_views.flat_map(|view| view[own.clone()].iter().copied()).collect();
            let found = gradients(
                Instructions::widest(),
                &scale.squares.means(kept.pictures.storage()),
                shape[0],
                &waves[own.clone()],
                &filters[3 * own.start..3 * own.end],
                scale.weights.as_deref(),
                &gradient,
            );
            scale.squares.spread(found)
        };
        let mut scales = kept.scales.iter().rev().map(of_scale);
        let mut sum = scales.next().unwrap_or_else(|| vec![0.0; shape.num_elements()]);
        for more in scales {
            sum.iter_mut().zip(&more).for_each(|(sum, more)| *sum += more);
        }
        FloatTensor::<Self>::from_data(TensorData::new(sum, shape))
    }
}

fn squares(pictures: &FloatTensor<Flex>, side: usize) -> Squares {
    let shape = pictures.shape();
    Squares {
        height: shape[2],
        width: shape[3],
        side,
    }
}
