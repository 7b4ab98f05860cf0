//! Takes some pictures out of a batch and puts all back in their order.
use burn::tensor::{Device, Int, Tensor, TensorData};

/// Pictures of a batch that were processed together, and their positions in the batch.
pub(crate) type Group = (Vec<usize>, Tensor<4>);

/// The pictures at `positions`, `[positions, c, h, w]`.
pub(crate) fn take(pictures: &Tensor<4>, positions: &[usize]) -> Tensor<4> {
    let all = pictures.dims()[0];
    if positions.iter().copied().eq(0..all) {
        return pictures.clone();
    }
    pictures.clone().select(0, indices(positions, &pictures.device()))
}

/// The batch that `groups` make up, in order. `None` if there are none.
pub(crate) fn assemble(groups: Vec<Group>) -> Option<Tensor<4>> {
    let device = groups.first()?.1.device();
    let (positions, tensors): (Vec<_>, Vec<_>) = groups.into_iter().unzip();
    let positions = positions.concat();
    let joined = Tensor::cat(tensors, 0);
    let mut back: Vec<usize> = (0..positions.len()).collect();
    back.sort_by_key(|&place| positions.get(place));
    if back.iter().copied().eq(0..back.len()) {
        return Some(joined);
    }
    Some(joined.select(0, indices(&back, &device)))
}

/// The same numbers as a tensor.
fn indices(values: &[usize], device: &Device) -> Tensor<1, Int> {
    let values: Vec<i32> = values.iter().map(|&v| v as i32).collect();
    let count = values.len();
    Tensor::from_data(TensorData::new(values, [count]), device)
}

/// One number a picture, `[b, 1, 1, 1]`.
pub(crate) fn one_each(values: impl IntoIterator<Item = f32>, device: &Device) -> Tensor<4> {
    let values: Vec<f32> = values.into_iter().collect();
    let count = values.len();
    Tensor::from_data(TensorData::new(values, [count, 1, 1, 1]), device)
}
