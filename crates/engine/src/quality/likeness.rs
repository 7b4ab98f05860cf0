//! How alike two pictures are, and the gradient of that to one of them, computed on the CPU without a graph.
//!
//! The same L1, squared difference and SSIM as by tensors ([`super::Ssim`]); a plane of a colour and a part of its rows
//! is a task, and sums are taken in a fixed order.
use rayon::prelude::*;
use std::ops::Range;

use super::ssim::{C1, C2};
use super::window::{Product, Window};
use crate::picture::Picture;
use crate::simd::{Instructions, Vectorised, multiply_add};

/// Rows of a task where only the value is asked for.
const ROWS: usize = 64;

/// What each term counts in a gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LikenessWeights {
    /// Mean absolute difference.
    pub l1: f32,
    /// Mean squared difference.
    pub l2: f32,
    /// SSIM; negative where likeness is to grow.
    pub ssim: f32,
}

/// Means over pixels and colours.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Likeness {
    /// Of absolute differences.
    pub l1: f64,
    /// Of SSIM.
    pub ssim: f64,
}

/// Two colour planes of pictures: `[height][width]`.
struct Planes {
    x: Vec<f32>,
    y: Vec<f32>,
    width: usize,
    height: usize,
}

impl Planes {
    /// With each value `changed`.
    fn new(original: &Picture, marked: &Picture, channel: usize, changed: fn(f32) -> f32) -> Self {
        let plane = |picture: &Picture| -> Vec<f32> {
            let values = picture.pixels.chunks_exact(3);
            values.map(|pixel| changed(pixel[channel])).collect()
        };
        Self {
            x: plane(original),
            y: plane(marked),
            width: original.width as usize,
            height: original.height as usize,
        }
    }
}

/// Mean SSIM of two pictures of one size that is not empty, values as they are.
pub(super) fn mean_ssim(original: &Picture, marked: &Picture) -> f64 {
    let planes: Vec<Planes> = (0..3)
        .map(|channel| Planes::new(original, marked, channel, |v| v))
        .collect();
    let height = original.height as usize;
    let parts = height.div_ceil(ROWS);
    let sums: Vec<f64> = (0..3 * parts)
        .into_par_iter()
        .map(|task| {
            let first = task % parts * ROWS;
            let rows = first..height.min(first + ROWS);
            let work = Similarity {
                planes: &planes[task / parts],
                rows,
                slopes: false,
            };
            Instructions::widest().run(work).0
        })
        .collect();
    sums.iter().sum::<f64>() / original.pixels.len() as f64
}

/// Likeness of each pair of original and marked pictures, all of one size, and the gradient of the weighted terms of all
/// pairs' mean to the marked ones, laid out as their pixels. Where a colour is beyond what a file can hold its gradient is 0.
pub(crate) fn likeness_with_gradient(
    pairs: &[(&Picture, &Picture)],
    weights: LikenessWeights,
) -> (Vec<Likeness>, Vec<Vec<f32>>) {
    let planes: Vec<(f64, f64, Vec<f32>)> = (0..3 * pairs.len())
        .into_par_iter()
        .map(|task| {
            let (original, marked) = pairs[task / 3];
            let planes = &Planes::new(original, marked, task % 3, |v| v.clamp(0.0, 1.0));
            let scale = 1.0 / (original.pixels.len() * pairs.len()) as f32;
            Instructions::widest().run(ToPlane { planes, weights, scale })
        })
        .collect();
    let results = pairs
        .par_iter()
        .zip(planes.par_chunks_exact(3))
        .map(|((_, marked), planes)| {
            let mut gradient = vec![0.0; marked.pixels.len()];
            for (at, (out, shown)) in gradient
                .chunks_exact_mut(3)
                .zip(marked.pixels.chunks_exact(3))
                .enumerate()
            {
                for channel in 0..3 {
                    let seen = (0.0..=1.0).contains(&shown[channel]);
                    out[channel] = if seen { planes[channel].2[at] } else { 0.0 };
                }
            }
            let mean =
                |of: fn(&(f64, f64, Vec<f32>)) -> f64| planes.iter().map(of).sum::<f64>() / gradient.len() as f64;
            let likeness = Likeness {
                l1: mean(|plane| plane.0),
                ssim: mean(|plane| plane.1),
            };
            (likeness, gradient)
        });
    results.unzip()
}

/// The sum of SSIM over some rows of a plane, and where `slopes` are wanted its derivatives at each pixel by the window's
/// means of y, of y squared and of x y.
struct Similarity<'a> {
    planes: &'a Planes,
    rows: Range<usize>,
    slopes: bool,
}

impl Vectorised for Similarity<'_> {
    type Output = (f64, [Vec<f32>; 3]);

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Self::Output {
        let Self { planes, rows, slopes } = self;
        let width = planes.width;
        let mut window = Window::new(width);
        let mut means: [Vec<f32>; 5] = Default::default();
        // A loop, since closures need not be inlined, and would not have the instructions then.
        for (means, product) in means.iter_mut().zip(Product::ALL) {
            *means = window.blur::<FUSED>(&planes.x, &planes.y, product, rows.clone());
        }
        let [mx, mut my, xx, mut yy, mut xy] = means;
        let mut sum = 0.0;
        let lines = mx.chunks_exact(width).zip(xx.chunks_exact(width));
        let changed = (my.chunks_exact_mut(width).zip(yy.chunks_exact_mut(width))).zip(xy.chunks_exact_mut(width));
        let mut values = vec![0.0; width];
        for ((mx, xx), ((my, yy), xy)) in lines.zip(changed) {
            for i in 0..width {
                let (x, y) = (mx[i], my[i]);
                let (same, squares) = (x * y, x * x + y * y);
                let (a, b) = (2.0 * same + C1, squares + C1);
                let (c, d) = (2.0 * (xy[i] - same) + C2, xx[i] + yy[i] - squares + C2);
                let scale = 1.0 / (b * d);
                let value = a * c * scale;
                values[i] = value;
                if slopes {
                    my[i] = 2.0 * (x * (c - a) * scale + y * value * (b - d) * scale);
                    yy[i] = -value * b * scale;
                    xy[i] = 2.0 * a * scale;
                }
            }
            sum += values.iter().map(|v| f64::from(*v)).sum::<f64>();
        }
        (sum, [my, yy, xy])
    }
}

/// Sums of absolute differences and of SSIM over a plane, and the gradient of the weighted terms times `scale`.
struct ToPlane<'a> {
    planes: &'a Planes,
    weights: LikenessWeights,
    scale: f32,
}

impl Vectorised for ToPlane<'_> {
    type Output = (f64, f64, Vec<f32>);

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Self::Output {
        let Self { planes, weights, scale } = self;
        let (width, height) = (planes.width, planes.height);
        let rows = 0..height;
        let (ssim, mut slopes) = Similarity {
            planes,
            rows: rows.clone(),
            slopes: true,
        }
        .run::<FUSED>();
        // The window is symmetric, so what a pixel gives to windows is what windows around it take.
        let mut window = Window::new(width);
        for slope in &mut slopes {
            *slope = window.blur::<FUSED>(slope, slope, Product::First, rows.clone());
        }
        let [mut gradient, by_square, by_product] = slopes;
        let LikenessWeights { l1, l2, ssim: of_ssim } = weights;
        let mut absolute = 0.0;
        let lines = planes.x.chunks_exact(width).zip(planes.y.chunks_exact(width));
        let by_window = by_square.chunks_exact(width).zip(by_product.chunks_exact(width));
        for (out, ((x, y), (square, product))) in gradient.chunks_exact_mut(width).zip(lines.zip(by_window)) {
            for i in 0..width {
                let difference = y[i] - x[i];
                let similarity = multiply_add::<FUSED>(x[i], product[i], out[i]);
                let similarity = multiply_add::<FUSED>(2.0 * y[i], square[i], similarity);
                let sign = f32::from(difference > 0.0) - f32::from(difference < 0.0);
                out[i] = scale * (of_ssim * similarity + 2.0 * l2 * difference + l1 * sign);
            }
            absolute += x.iter().zip(y).map(|(x, y)| f64::from((y - x).abs())).sum::<f64>();
        }
        (absolute, ssim, gradient)
    }
}

#[cfg(test)]
mod tests;
