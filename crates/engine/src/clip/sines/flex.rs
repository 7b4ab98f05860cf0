//! Mean sines on burn's CPU device.
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
    /// Weights `[b][pixels]` of squares; none where all weigh alike.
    weights: Option<Vec<f32>>,
    side: usize,
}

impl MeanSines for Flex {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
        equalization: f32,
    ) -> FloatTensor<Self> {
        Self::means(pictures, filters, phases, side, equalization).0
    }
}

impl WeightedSines for Flex {
    type Kept = Kept;

    fn means(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
        equalization: f32,
    ) -> (FloatTensor<Self>, Kept) {
        let (squares, views) = (squares(&pictures, side), pictures.shape()[0]);
        let shape = Shape::new([views, phases.shape()[0]]);
        let [pictures, filters, phases] = [pictures, filters, phases].map(|t| t.to_contiguous());
        let of_squares = squares.means(pictures.storage());
        let weighted = equalization != 0.0;
        let weights = weighted.then(|| density::weights(Instructions::widest(), &of_squares, views, equalization));
        let waves = waves(filters.storage(), phases.storage(), 0.0);
        let means = means(Instructions::widest(), &of_squares, views, &waves, weights.as_deref());
        let kept = Kept {
            pictures,
            filters,
            phases,
            weights,
            side,
        };
        (FloatTensor::<Self>::from_data(TensorData::new(means, shape)), kept)
    }

    fn means_backward(kept: Kept, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        let (squares, shape) = (squares(&kept.pictures, kept.side), kept.pictures.shape());
        let gradient = gradient.to_contiguous();
        let filters: &[f32] = kept.filters.storage();
        let waves = waves(filters, kept.phases.storage(), QUARTER);
        let found = gradients(
            Instructions::widest(),
            &squares.means(kept.pictures.storage()),
            shape[0],
            &waves,
            filters,
            kept.weights.as_deref(),
            gradient.storage(),
        );
        FloatTensor::<Self>::from_data(TensorData::new(squares.spread(found), shape))
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
