//! Mean sines on burn's CPU device.
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::{Shape, TensorData};

use super::cpu::{QUARTER, gradients, means, waves};
use super::density;
use super::pool::Squares;
use super::{FloatTensor, MeanSines, WeightedSines};
use crate::simd::Instructions;

impl MeanSines for Flex {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
        equalization: f32,
    ) -> FloatTensor<Self> {
        let weights = Self::weights(pictures.clone(), side, equalization);
        Self::sums(pictures, filters, phases, weights, side)
    }
}

impl WeightedSines for Flex {
    fn weights(pictures: FloatTensor<Self>, side: usize, equalization: f32) -> Option<FloatTensor<Self>> {
        if equalization == 0.0 {
            return None;
        }
        let (squares, views) = (squares(&pictures, side), pictures.shape()[0]);
        let pictures = pictures.to_contiguous();
        let weights = density::weights(
            Instructions::widest(),
            &squares.means(pictures.storage()),
            views,
            equalization,
        );
        let shape = Shape::new([views, squares.count()]);
        Some(FloatTensor::<Self>::from_data(TensorData::new(weights, shape)))
    }

    fn sums(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        weights: Option<FloatTensor<Self>>,
        side: usize,
    ) -> FloatTensor<Self> {
        let (squares, views) = (squares(&pictures, side), pictures.shape()[0]);
        let shape = Shape::new([views, phases.shape()[0]]);
        let [pictures, filters, phases] = [pictures, filters, phases].map(|t| t.to_contiguous());
        let weights = weights.map(|t| t.to_contiguous());
        let waves = waves(filters.storage(), phases.storage(), 0.0);
        let pictures = squares.means(pictures.storage());
        let weights = weights.as_ref().map(|t| t.storage());
        let means = means(Instructions::widest(), &pictures, views, &waves, weights);
        FloatTensor::<Self>::from_data(TensorData::new(means, shape))
    }

    fn sums_backward(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        weights: Option<FloatTensor<Self>>,
        gradient: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let (squares, shape) = (squares(&pictures, side), pictures.shape());
        let tensors = [pictures, filters, phases, gradient];
        let [pictures, filters, phases, gradient] = tensors.map(|t| t.to_contiguous());
        let weights = weights.map(|t| t.to_contiguous());
        let filters: &[f32] = filters.storage();
        let waves = waves(filters, phases.storage(), QUARTER);
        let pictures = squares.means(pictures.storage());
        let found = gradients(
            Instructions::widest(),
            &pictures,
            shape[0],
            &waves,
            filters,
            weights.as_ref().map(|t| t.storage()),
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
