//! What is left of JPEG in a picture that was averaged down fivefold afterwards, computed at the small size.
//!
//! A picture of 800 pixels that is read at 160 has squares of 8 pixels of luma and 16 of halved chroma, which are 1.6 and
//! 3.2 small ones. Here they are 2 and 4: the mean of a square is rounded to the step of its constant coefficient, and
//! what differs from it (within chroma: means of halves) to that of the lowest other ones. Finer coefficients are
//! averaged away. It costs a hundredth of compressing an enlarged picture.
use burn::tensor::module::avg_pool2d;
use burn::tensor::ops::{AvgPoolOptions, PadMode};
use burn::tensor::{Tensor, TensorData};

use super::{from_ycbcr, tables, to_ycbcr};
use crate::rounding::round_straight_through;

/// Sides of the squares of luma and chroma, small pixels.
const LUMA: usize = 2;
const CHROMA: usize = 4;
/// Size of a coefficient for a mean of 1, and for a wave of the lowest frequency of amplitude 1.
const CONSTANT: f32 = 8.0;
const WAVE: f32 = 5.656_854;

/// How one small picture is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReducedJpeg {
    /// libjpeg's quality, within 1 and 100.
    pub quality: u8,
}

/// Compresses small pictures `[b, 3, h, w]` in [0, 1], one quality each, with squares that begin `offset` pixels (down,
/// right; less than 4) before the pictures' corners; the result is clamped to [0, 1]. The gradient of rounding is the identity's.
pub fn reduced_jpeg(pictures: Tensor<4>, each: &[ReducedJpeg], offset: [usize; 2]) -> Tensor<4> {
    let [b, _, h, w] = pictures.dims();
    if each.len() != b || b == 0 || h == 0 || w == 0 {
        return pictures;
    }
    let device = pictures.device();
    let [top, left] = offset.map(|side| side % CHROMA);
    let [height, width] = [top + h, left + w].map(|side| side.next_multiple_of(CHROMA));
    let padding = [(top, height - top - h), (left, width - left - w)];
    let x = pictures.pad(padding, PadMode::Edge);
    let flat = x.reshape([b, 3, height * width]);
    let x = to_ycbcr(&device).matmul(flat).reshape([b, 3, height, width]);

    let steps = |table: usize, coefficients: &[usize], size: f32| {
        let step = |one: &ReducedJpeg| {
            let steps = tables::tables(one.quality)[table];
            let sum: f32 = coefficients.iter().map(|c| steps[*c]).sum();
            sum / coefficients.len() as f32 / size / 255.0
        };
        let steps: Vec<f32> = each.iter().map(step).collect();
        Tensor::<4>::from_data(TensorData::new(steps, [b, 1, 1, 1]), &device)
    };
    let round = |x: Tensor<4>, steps: Tensor<4>| round_straight_through(x / steps.clone()) * steps;
    // Frequencies (0, 1), (1, 0) and (1, 1).
    let lowest = [1, 8, 9];

    let luma = x.clone().slice([0..b, 0..1]);
    let mean = averaged(luma.clone(), LUMA);
    let rest = luma - repeated(mean.clone(), LUMA);
    let luma = repeated(round(mean, steps(0, &[0], CONSTANT)), LUMA) + round(rest, steps(0, &lowest, WAVE));

    let halves = averaged(x.slice([0..b, 1..3]), CHROMA / 2);
    let mean = averaged(halves.clone(), 2);
    let rest = halves - repeated(mean.clone(), 2);
    let halves = repeated(round(mean, steps(1, &[0], CONSTANT)), 2) + round(rest, steps(1, &lowest, WAVE));
    let chroma = repeated(halves, CHROMA / 2);

    let flat = Tensor::cat(vec![luma, chroma], 1).reshape([b, 3, height * width]);
    let x = from_ycbcr(&device).matmul(flat).reshape([b, 3, height, width]);
    x.slice([0..b, 0..3, top..top + h, left..left + w]).clamp(0.0, 1.0)
}

fn averaged(x: Tensor<4>, side: usize) -> Tensor<4> {
    avg_pool2d(x, AvgPoolOptions::new([side; 2]).with_stride([side; 2]))
}

/// Each pixel as a square.
fn repeated(x: Tensor<4>, side: usize) -> Tensor<4> {
    let [b, c, h, w] = x.dims();
    let wide = x.reshape([b, c, h, 1, w, 1]).expand([b, c, h, side, w, side]);
    wide.reshape([b, c, h * side, w * side])
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::draw::Draw;
    use crate::jpeg::{Chroma, Jpeg};
    use crate::layer::Layer;
    use crate::matrices::{Lines, resample};

    const SIDE: usize = 32;
    const TIMES: usize = 5;

    /// Soft random colours.
    fn picture(device: &Device) -> Tensor<4> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let values: Vec<f32> = (0..3 * 8 * 8).map(|_| rng.random_range(0.2..0.8)).collect();
        let coarse = Tensor::<4>::from_data(TensorData::new(values, [1, 3, 8, 8]), device);
        let lines = [Lines::resize(8, SIDE)];
        resample(coarse, &lines, &lines)
    }

    fn rms(a: &Tensor<4>, b: &Tensor<4>) -> f32 {
        let difference: Vec<f32> = (a.clone() - b.clone()).try_into_vec_as().unwrap();
        (difference.iter().map(|d| d * d).sum::<f32>() / difference.len() as f32).sqrt()
    }

    #[test]
    fn it_changes_about_as_much_as_jpeg_of_the_large_picture_does() {
        let device = Device::flex();
        let small = picture(&device);
        let lines = [Lines::resize(SIDE, SIDE * TIMES)];
        let large = resample(small.clone(), &lines, &lines);
        for quality in [10, 20, 40, 75] {
            let jpeg = Draw::Jpeg(Jpeg {
                quality,
                chroma: Chroma::Half,
                noise: None,
            });
            let done = Layer::default().apply_with(&[jpeg], large.clone(), [1.0; 3]).unwrap();
            let real = rms(&averaged(done, TIMES), &averaged(large.clone(), TIMES));
            let stand_in = rms(&reduced_jpeg(small.clone(), &[ReducedJpeg { quality }], [1, 2]), &small);
            assert!(
                (0.5..2.0).contains(&(stand_in / real)),
                "{quality}: {stand_in} for {real}"
            );
        }
    }

    #[test]
    fn sizes_that_are_no_multiples_keep_their_shape_and_nothing_has_no_pixels() {
        let device = Device::flex();
        for [h, w] in [[1, 1], [7, 10], [160, 4]] {
            let picture = Tensor::<4>::full([2, 3, h, w], 0.4, &device);
            let done = reduced_jpeg(picture, &[ReducedJpeg { quality: 10 }; 2], [3, 1]);
            assert_eq!(done.dims(), [2, 3, h, w]);
        }
    }

    #[test]
    fn its_gradient_is_that_of_averaging_chroma() {
        let device = Device::flex().autodiff();
        let leaf = Tensor::<4>::full([1, 3, 8, 8], 0.45, &device).require_grad();
        let done = reduced_jpeg(leaf.clone(), &[ReducedJpeg { quality: 30 }], [0, 0]);
        let gradient = leaf.grad(&done.sum().backward()).unwrap();
        let values: Vec<f32> = gradient.try_into_vec_as().unwrap();
        assert!(values.iter().all(|v| (v - 1.0).abs() < 1e-4), "{values:?}");
    }
}
