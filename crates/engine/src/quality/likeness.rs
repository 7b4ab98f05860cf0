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
mod tests {
    use super::*;
    use crate::quality::window::{RADIUS, weight};

    fn picture(width: u32, height: u32, seed: u32) -> Picture {
        let value = |i: u32| ((i * 7 + seed * 13) % 29) as f32 / 26.0 - 0.05;
        Picture {
            width,
            height,
            pixels: (0..3 * width * height).map(value).collect(),
        }
    }

    fn clamped(picture: &Picture) -> Picture {
        let pixels = picture.pixels.iter().map(|v| v.clamp(0.0, 1.0)).collect();
        Picture { pixels, ..*picture }
    }

    /// The weighted terms by their definitions, window by window, in f64; and L1 and SSIM.
    fn reference(x: &Picture, y: &Picture, weights: LikenessWeights) -> [f64; 3] {
        let (width, height) = (x.width as usize, x.height as usize);
        let value = |picture: &Picture, at: usize| f64::from(picture.pixels[at]).clamp(0.0, 1.0);
        let [mut l1, mut l2, mut ssim] = [0.0; 3];
        for at in 0..x.pixels.len() {
            let (channel, column, row) = (at % 3, at / 3 % width, at / 3 / width);
            let mut m = [0.0; 5];
            for v in row.saturating_sub(RADIUS)..height.min(row + RADIUS + 1) {
                for u in column.saturating_sub(RADIUS)..width.min(column + RADIUS + 1) {
                    let share = weight(u.abs_diff(column)) * weight(v.abs_diff(row));
                    let near = (v * width + u) * 3 + channel;
                    let (a, b) = (value(x, near), value(y, near));
                    let moments = [a, b, a * a, b * b, a * b];
                    m.iter_mut().zip(moments).for_each(|(m, value)| *m += share * value);
                }
            }
            let [a, b, aa, bb, ab] = m;
            let (c1, c2) = (1e-4, 9e-4);
            let numerator = (2.0 * a * b + c1) * (2.0 * (ab - a * b) + c2);
            ssim += numerator / ((a * a + b * b + c1) * (aa - a * a + bb - b * b + c2));
            let difference = value(y, at) - value(x, at);
            (l1, l2) = (l1 + difference.abs(), l2 + difference * difference);
        }
        let [l1, l2, ssim] = [l1, l2, ssim].map(|sum| sum / x.pixels.len() as f64);
        let terms = [(weights.l1, l1), (weights.l2, l2), (weights.ssim, ssim)];
        [terms.iter().map(|(w, term)| f64::from(*w) * term).sum(), l1, ssim]
    }

    #[test]
    fn values_and_gradient_are_those_of_the_definition() {
        let weights = LikenessWeights {
            l1: 0.3,
            l2: 5.0,
            ssim: -2.0,
        };
        let pairs = [
            (picture(19, 13, 1), picture(19, 13, 2)),
            (picture(19, 13, 3), picture(19, 13, 9)),
        ];
        let borrowed: Vec<(&Picture, &Picture)> = pairs.iter().map(|(a, b)| (a, b)).collect();
        let (found, gradients) = likeness_with_gradient(&borrowed, weights);
        for (((x, y), found), gradient) in pairs.iter().zip(&found).zip(&gradients) {
            let [_, l1, ssim] = reference(x, y, weights);
            assert!(
                (found.l1 - l1).abs() < 1e-6 && (found.ssim - ssim).abs() < 1e-5,
                "{found:?}"
            );
            assert!((mean_ssim(&clamped(x), &clamped(y)) - ssim).abs() < 1e-5);
            let mut beyond = 0;
            for at in (0..y.pixels.len()).step_by(17) {
                let shown = y.pixels[at];
                if !(0.0..=1.0).contains(&shown) {
                    assert_eq!(gradient[at], 0.0);
                    beyond += 1;
                    continue;
                }
                if !(0.01..0.99).contains(&shown) || (shown - x.pixels[at]).abs() < 0.01 {
                    continue; // no slope there, or two
                }
                let moved = |step: f32| {
                    let mut moved = y.clone();
                    moved.pixels[at] += step;
                    reference(x, &moved, weights)[0]
                };
                // The mean is over both pairs.
                let slope = (moved(1e-3) - moved(-1e-3)) / 2e-3 / 2.0;
                let gap = (f64::from(gradient[at]) - slope).abs();
                assert!(gap < 1e-6 + 2e-3 * slope.abs(), "{at}: {} {slope}", gradient[at]);
            }
            assert!(beyond > 0);
        }
    }

    #[test]
    fn parts_of_rows_and_threads_make_no_difference() {
        let (x, y) = (clamped(&picture(31, 150, 1)), clamped(&picture(31, 150, 5)));
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| mean_ssim(&x, &y))
        };
        assert_eq!(with(1).to_bits(), with(3).to_bits());
        assert!(
            (with(1)
                - reference(
                    &x,
                    &y,
                    LikenessWeights {
                        l1: 0.0,
                        l2: 0.0,
                        ssim: 0.0
                    }
                )[2])
                .abs()
                < 1e-5
        );
    }
}
