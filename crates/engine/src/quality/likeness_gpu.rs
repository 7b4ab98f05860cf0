//! Likeness and its gradient on a card: CubeCL kernels that do what [`super::likeness`] does on the CPU.
//!
//! A unit a pixel of a plane. The window is separable, so what is averaged is averaged along rows first.
// The launch functions that the macro makes carry no documentation.
#![allow(missing_docs)]
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::{DType, Shape, Tensor};
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;
use cubecl::server::Handle;

use super::likeness::LikenessWeights;
use super::ssim::{C1, C2};
use super::window::{RADIUS, weight};
use crate::error::{Error, Result};
use crate::launch::{Buffer, CUBE, a_cube_each, cube_of_layer, empty_tensor, grid, sum_of_cube};

const UNITS: usize = CUBE as usize;

/// The weight of a tap of the window.
fn tap_weight(tap: usize) -> f32 {
    weight(tap.abs_diff(RADIUS)) as f32
}

/// Averages along rows of x, y, x squared, y squared and x y: `across` is `[5][planes][height][width]`.
#[cube(launch)]
fn moments_along_rows(x: &[f32], y: &[f32], across: &mut [f32], width: u32) {
    let at = ABSOLUTE_POS;
    let count = x.len();
    if at < count {
        let width = width as usize;
        let column = at % width;
        let mut mx = 0.0f32;
        let mut my = 0.0f32;
        let mut xx = 0.0f32;
        let mut yy = 0.0f32;
        let mut xy = 0.0f32;
        #[unroll]
        for tap in 0..comptime!(2 * RADIUS + 1) {
            // The window's part beyond the border counts as zeros.
            if column + tap >= RADIUS && column + tap < width + RADIUS {
                let near = at + tap - RADIUS;
                let a = f32::clamp(x[near], 0.0f32, 1.0f32);
                let b = f32::clamp(y[near], 0.0f32, 1.0f32);
                let share = comptime!(tap_weight(tap));
                mx += share * a;
                my += share * b;
                xx += share * a * a;
                yy += share * b * b;
                xy += share * a * b;
            }
        }
        across[at] = mx;
        across[count + at] = my;
        across[2 * count + at] = xx;
        across[3 * count + at] = yy;
        across[4 * count + at] = xy;
    }
}

/// SSIM of each pixel to the first part of `values` (`[3][planes][height][width]`), and its derivatives by the window's means
/// of y, of y squared and of x y: `slopes`, of the same shape.
#[cube(launch)]
fn similarity(across: &[f32], values: &mut [f32], slopes: &mut [f32], width: u32, height: u32) {
    let at = ABSOLUTE_POS;
    let count = values.len() / 3;
    if at < count {
        let width = width as usize;
        let height = height as usize;
        let row = at / width % height;
        let mut x = 0.0f32;
        let mut y = 0.0f32;
        let mut xx = 0.0f32;
        let mut yy = 0.0f32;
        let mut xy = 0.0f32;
        #[unroll]
        for tap in 0..comptime!(2 * RADIUS + 1) {
            if row + tap >= RADIUS && row + tap < height + RADIUS {
                let near = at + tap * width - RADIUS * width;
                let share = comptime!(tap_weight(tap));
                x += share * across[near];
                y += share * across[count + near];
                xx += share * across[2 * count + near];
                yy += share * across[3 * count + near];
                xy += share * across[4 * count + near];
            }
        }
        let same = x * y;
        let squares = x * x + y * y;
        let a = 2.0f32 * same + C1;
        let b = squares + C1;
        let c = 2.0f32 * (xy - same) + C2;
        let d = xx + yy - squares + C2;
        let scale = 1.0f32 / (b * d);
        let value = a * c * scale;
        values[at] = value;
        slopes[at] = 2.0f32 * (x * (c - a) * scale + y * value * (b - d) * scale);
        slopes[count + at] = -value * b * scale;
        slopes[2 * count + at] = 2.0f32 * a * scale;
    }
}

/// Averages along rows of three planes for each of `slopes`.
#[cube(launch)]
fn slopes_along_rows(slopes: &[f32], across: &mut [f32], width: u32) {
    let at = ABSOLUTE_POS;
    if at < slopes.len() {
        let width = width as usize;
        let column = at % width;
        let mut sum = 0.0f32;
        #[unroll]
        for tap in 0..comptime!(2 * RADIUS + 1) {
            if column + tap >= RADIUS && column + tap < width + RADIUS {
                sum += comptime!(tap_weight(tap)) * slopes[at + tap - RADIUS];
            }
        }
        across[at] = sum;
    }
}

/// The gradient to each value of y, 0 where it is beyond what a file can hold; what that can hold of it to `clamped`; absolute
/// and squared differences to the second and third part of `values`.
#[cube(launch)]
fn to_marked(
    x: &[f32],
    y: &[f32],
    across: &[f32],
    values: &mut [f32],
    gradient: &mut [f32],
    clamped: &mut [f32],
    width: u32,
    height: u32,
    of_l1: f32,
    of_l2: f32,
    of_ssim: f32,
) {
    let at = ABSOLUTE_POS;
    let count = x.len();
    if at < count {
        let width = width as usize;
        let height = height as usize;
        let row = at / width % height;
        let mut by_mean = 0.0f32;
        let mut by_square = 0.0f32;
        let mut by_product = 0.0f32;
        #[unroll]
        for tap in 0..comptime!(2 * RADIUS + 1) {
            if row + tap >= RADIUS && row + tap < height + RADIUS {
                let near = at + tap * width - RADIUS * width;
                let share = comptime!(tap_weight(tap));
                by_mean += share * across[near];
                by_square += share * across[count + near];
                by_product += share * across[2 * count + near];
            }
        }
        let a = f32::clamp(x[at], 0.0f32, 1.0f32);
        let b = f32::clamp(y[at], 0.0f32, 1.0f32);
        let difference = b - a;
        let mut sign = 0.0f32;
        if difference > 0.0f32 {
            sign = 1.0f32;
        }
        if difference < 0.0f32 {
            sign = -1.0f32;
        }
        let similarity = by_mean + 2.0f32 * b * by_square + a * by_product;
        let mut slope = of_ssim * similarity + 2.0f32 * of_l2 * difference + of_l1 * sign;
        if y[at] < 0.0f32 || y[at] > 1.0f32 {
            slope = 0.0f32;
        }
        gradient[at] = slope;
        clamped[at] = b;
        values[count + at] = f32::abs(difference);
        values[2 * count + at] = difference * difference;
    }
}

/// Adds `times` a gradient to clamped values to that of values.
#[cube(launch)]
fn add_to_marked(y: &[f32], of_clamped: &[f32], likeness: &[f32], gradient: &mut [f32], times: f32) {
    let at = ABSOLUTE_POS;
    if at < y.len() {
        let mut more = times * of_clamped[at];
        if y[at] < 0.0f32 || y[at] > 1.0f32 {
            more = 0.0f32;
        }
        gradient[at] = likeness[at] + more;
    }
}

/// A cube for each row of `values` (`[rows][len]`): its mean.
#[cube(launch)]
fn means_of_rows(values: &[f32], means: &mut [f32], len: u32, scale: f32) {
    let row = cube_of_layer();
    let unit = UNIT_POS as usize;
    let mut sums = Shared::<[f32]>::new_slice(UNITS);
    let mut sum = 0.0f32;
    let mut at = unit;
    while at < len as usize {
        sum += values[row * len as usize + at];
        at += UNITS;
    }
    let sum = sum_of_cube(sum, &mut sums);
    if unit == 0 {
        means[row] = sum * scale;
    }
}

/// Likeness of pictures on a card, and its gradient.
pub(crate) struct LikenessOnDevice {
    /// Means over pixels and colours of SSIM, of absolute and of squared differences, `[3, views]`.
    pub means: Tensor<2>,
    /// The marked pictures, `[views, 3, height, width]`, as files hold them.
    pub clamped: Tensor<4>,
    marked: CubeTensor,
    /// Of the weighted terms' mean over views to the marked pictures.
    gradient: CubeTensor,
}

impl LikenessOnDevice {
    /// Of pictures `[views, 3, height, width]` of one size, which are clamped to [0, 1]. Nothing is waited for.
    ///
    /// # Errors
    /// Tensors that are not on a card.
    pub fn new(original: Tensor<4>, marked: Tensor<4>, weights: LikenessWeights) -> Result<Self> {
        let [views, channels, height, width] = marked.dims();
        let count = views * channels * height * width;
        let [x, y] = [primitive(original)?, primitive(marked)?];
        let client = y.client.clone();
        let parts = [5, 3, 3, 1, 1];
        let [across, values, slopes, gradient, clamped] = parts.map(|parts| Buffer::empty(&client, parts * count));
        let (w, h) = (width as u32, height as u32);
        let scale = 1.0 / count as f32;
        let pictures = || [&x, &y].map(|tensor| tensor.clone().into_buffer_arg());

        let [of_x, of_y] = pictures();
        let (cubes, dim) = grid(count, 1);
        moments_along_rows::launch(&client, cubes, dim, of_x, of_y, across.argument(), w);
        let (cubes, dim) = grid(count, 1);
        let [of_across, of_values, of_slopes] = [&across, &values, &slopes].map(Buffer::argument);
        similarity::launch(&client, cubes, dim, of_across, of_values, of_slopes, w, h);
        // Averages of slopes take the place of those of pictures.
        let across = across.first(3 * count);
        let (cubes, dim) = grid(3 * count, 1);
        let [of_slopes, of_across] = [&slopes, &across].map(Buffer::argument);
        slopes_along_rows::launch(&client, cubes, dim, of_slopes, of_across, w);
        let [of_x, of_y] = pictures();
        let (cubes, dim) = grid(count, 1);
        to_marked::launch(
            &client,
            cubes,
            dim,
            of_x,
            of_y,
            across.argument(),
            values.argument(),
            gradient.argument(),
            clamped.argument(),
            w,
            h,
            scale * weights.l1,
            scale * weights.l2,
            scale * weights.ssim,
        );
        let (rows, len) = (3 * views, channels * height * width);
        let means = Buffer::empty(&client, rows);
        let (cubes, dim) = a_cube_each(rows);
        means_of_rows::launch(
            &client,
            cubes,
            dim,
            values.argument(),
            means.argument(),
            len as u32,
            1.0 / len as f32,
        );
        let shape = [views, channels, height, width];
        Ok(Self {
            means: Tensor::from_primitive::<Cube>(tensor(&y, means.handle, [3, views])),
            clamped: Tensor::from_primitive::<Cube>(tensor(&y, clamped.handle, shape)),
            gradient: tensor(&y, gradient.handle, shape),
            marked: y,
        })
    }

    /// The gradient to the marked pictures of the weighted terms, and of `times` what has the gradient `more` to
    /// [`LikenessOnDevice::clamped`].
    ///
    /// # Errors
    /// One that is not on a card.
    pub fn gradient_with(&self, more: Tensor<4>, times: f32) -> Result<Tensor<4>> {
        let more = primitive(more)?;
        let out = empty_tensor(&self.marked, self.marked.shape());
        let (cubes, dim) = grid(out.shape().num_elements(), 1);
        let [y, more, likeness, gradient] =
            [&self.marked, &more, &self.gradient, &out].map(|tensor| tensor.clone().into_buffer_arg());
        add_to_marked::launch(&self.marked.client, cubes, dim, y, more, likeness, gradient, times);
        Ok(Tensor::from_primitive::<Cube>(out))
    }
}

fn primitive(tensor: Tensor<4>) -> Result<CubeTensor> {
    let tensor = tensor.try_into_primitive::<Cube>().map_err(|e| Error::Device {
        device: "pictures".into(),
        reason: format!("{e:?}"),
    })?;
    Ok(into_contiguous(tensor))
}

/// A tensor of `handle`, where `like` is.
fn tensor<const D: usize>(like: &CubeTensor, handle: Handle, shape: [usize; D]) -> CubeTensor {
    let shape = Shape::from(shape.to_vec());
    CubeTensor::new_contiguous(like.client.clone(), like.device.clone(), shape, handle, DType::F32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Picture;
    use crate::quality::{batch, likeness_with_gradient, unbatch};
    use crate::testing::wgpu;

    #[test]
    fn a_card_and_the_cpu_agree() {
        let Some(compute) = wgpu() else { return };
        let device = compute.device;
        let picture = |seed: u32| Picture {
            width: 37,
            height: 21,
            pixels: (0..3 * 37 * 21)
                .map(|i: u32| ((i * 7 + seed * 13) % 29) as f32 / 26.0 - 0.05)
                .collect(),
        };
        let pictures: Vec<Picture> = (1..5).map(picture).collect();
        let [x, y] = [[&pictures[0], &pictures[1]], [&pictures[2], &pictures[3]]];
        let weights = LikenessWeights {
            l1: 0.3,
            l2: 5.0,
            ssim: -2.0,
        };
        let pairs = [(x[0], y[0]), (x[1], y[1])];
        let (want, gradients) = likeness_with_gradient(&pairs, weights);
        let found = LikenessOnDevice::new(batch(&x, &device).unwrap(), batch(&y, &device).unwrap(), weights).unwrap();
        let clamped = unbatch(found.clamped.clone()).unwrap();
        for (found, want) in clamped.iter().zip(y) {
            let same = found
                .pixels
                .iter()
                .zip(&want.pixels)
                .all(|(a, b)| *a == b.clamp(0.0, 1.0));
            assert!(same);
        }
        let ones = found.clamped.ones_like();
        let means = found.means.clone().try_into_vec_as::<f32>().unwrap();
        for (view, want) in want.iter().enumerate() {
            assert!((f64::from(means[view]) - want.ssim).abs() < 1e-5);
            assert!((f64::from(means[2 + view]) - want.l1).abs() < 1e-5);
            assert!(means[4 + view] > 0.0);
        }
        let found = [0.0, 1.0].map(|times| unbatch(found.gradient_with(ones.clone(), times).unwrap()).unwrap());
        let beyond = |value: f32| !(0.0..=1.0).contains(&value);
        for ((without, with), picture) in found[0].iter().zip(&found[1]).zip(y) {
            for ((without, with), value) in without.pixels.iter().zip(&with.pixels).zip(&picture.pixels) {
                let more = if beyond(*value) { 0.0 } else { 1.0 };
                assert!((with - without - more).abs() < 1e-5);
            }
        }
        let [found, _] = found;
        let largest = gradients.iter().flatten().fold(0.0_f32, |m, v| m.max(v.abs()));
        for (found, want) in found.iter().zip(&gradients) {
            let off = found.pixels.iter().zip(want).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0_f32, f32::max);
            assert!(largest > 0.0 && off < 1e-3 * largest, "{off} of {largest}");
        }
    }
}
