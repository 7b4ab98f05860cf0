//! Mean sines on burn's CPU device.
use burn::backend::{Flex, TensorMetadata};
use burn::tensor::{Shape, TensorData};

use super::cpu::{QUARTER, gradients, means, waves};
use super::pool::Squares;
use super::{FloatTensor, MeanSines, MeanSinesBackward};
use crate::simd::Instructions;

impl MeanSines for Flex {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let (squares, views) = (squares(&pictures, side), pictures.shape()[0]);
        let shape = Shape::new([views, phases.shape()[0]]);
        let [pictures, filters, phases] = [pictures, filters, phases].map(|t| t.to_contiguous());
        let waves = waves(filters.storage(), phases.storage(), 0.0);
        let pictures = squares.means(pictures.storage());
        let means = means(Instructions::widest(), &pictures, views, &waves);
        FloatTensor::<Self>::from_data(TensorData::new(means, shape))
    }
}

impl MeanSinesBackward for Flex {
    fn mean_sines_backward(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let (squares, shape) = (squares(&pictures, side), pictures.shape());
        let tensors = [pictures, filters, phases, gradient];
        let [pictures, filters, phases, gradient] = tensors.map(|t| t.to_contiguous());
        let filters: &[f32] = filters.storage();
        let waves = waves(filters, phases.storage(), QUARTER);
        let pictures = squares.means(pictures.storage());
        let instructions = Instructions::widest();
        let found = gradients(instructions, &pictures, shape[0], &waves, filters, gradient.storage());
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
