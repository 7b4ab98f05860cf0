//! Pictures as blocks of 8 x 8 pixels, and their discrete cosine transform.
use burn::tensor::{Device, Tensor, TensorData};

pub(super) const SIDE: usize = 8;
pub(super) const AREA: usize = SIDE * SIDE;

/// `[n, c, h, w]`, sides multiples of 8, to `[n, c * blocks, 64]`, pixels of a block row by row.
pub(super) fn split(x: Tensor<4>) -> Tensor<3> {
    let [n, c, h, w] = x.dims();
    let x = x.reshape([n * c, h / SIDE, SIDE, w / SIDE, SIDE]).swap_dims(2, 3);
    x.reshape([n, c * h * w / AREA, AREA])
}

/// The inverse of [`split`].
pub(super) fn join(blocks: Tensor<3>, [n, c, h, w]: [usize; 4]) -> Tensor<4> {
    let x = blocks.reshape([n * c, h / SIDE, w / SIDE, SIDE, SIDE]).swap_dims(2, 3);
    x.reshape([n, c, h, w])
}

/// `[1, 64 pixels, 64 frequencies]`: the orthonormal two-dimensional DCT-II of T.81 A.3.3 as one matrix, so that both
/// axes of all blocks are one product. Its transpose is its inverse.
pub(super) fn dct(device: &Device) -> Tensor<3> {
    let cosine = |frequency: usize, at: usize| {
        let scale = if frequency == 0 { 0.125_f64 } else { 0.25 }.sqrt();
        scale * ((2 * at + 1) as f64 * frequency as f64 * std::f64::consts::PI / 16.0).cos()
    };
    let element = |i: usize| {
        let (pixel, frequency) = (i / AREA, i % AREA);
        let along_y = cosine(frequency / SIDE, pixel / SIDE);
        (along_y * cosine(frequency % SIDE, pixel % SIDE)) as f32
    };
    let matrix: Vec<f32> = (0..AREA * AREA).map(element).collect();
    Tensor::from_data(TensorData::new(matrix, [1, AREA, AREA]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn host<const D: usize>(x: Tensor<D>) -> Vec<f32> {
        x.try_into_vec_as::<f32>().unwrap()
    }

    #[test]
    fn blocks_are_where_they_belong_and_joined_again() {
        let (h, w) = (16, 24);
        let values: Vec<f32> = (0..2 * 3 * h * w).map(|i| i as f32).collect();
        let x = Tensor::<4>::from_data(TensorData::new(values.clone(), [2, 3, h, w]), &Device::flex());
        let blocks = split(x.clone());
        assert_eq!(blocks.dims(), [2, 18, 64]);
        let found = host(blocks.clone());
        // Block 4 is the second of the second row: its second row of pixels begins at (9, 8).
        assert_eq!(found[4 * 64 + 8], values[9 * w + 8]);
        assert_eq!(host(join(blocks, x.dims())), values);
    }

    #[test]
    fn the_transform_is_orthonormal_and_the_first_frequency_is_eight_means() {
        let matrix = dct(&Device::flex());
        let product = host(matrix.clone().matmul(matrix.clone().swap_dims(1, 2)));
        for (i, value) in product.iter().enumerate() {
            let expected = if i % 65 == 0 { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-6);
        }
        let constant = Tensor::<3>::full([1, 1, 64], 3.0, &Device::flex());
        let frequencies = host(constant.matmul(matrix));
        assert!((frequencies[0] - 24.0).abs() < 1e-4);
        assert!(frequencies[1..].iter().all(|f| f.abs() < 1e-5));
    }
}
