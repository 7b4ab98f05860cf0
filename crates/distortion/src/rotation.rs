//! Pictures turned about their centre.
//!
//! Each new pixel takes four old ones with bilinear weights. The four are gathered one by one: of a grid that is only
//! turned, at most two pixels fall between the same four neighbours, so that the gradient of each gather adds at most
//! two numbers to a pixel. A sum of two is the same in either order, so gradients are the same from run to run also on
//! devices that add in no fixed order.
use burn::tensor::{Device, Tensor, TensorData};

use crate::groups::one_each;

/// Angles below this move no pixel of a picture of 4000 x 4000 by a hundredth of a pixel, and are taken as none.
const SMALLEST_DEGREES: f32 = 2e-4;

/// Turns pictures `[b, 3, h, w]` counter-clockwise by one angle each, in degrees, as torchvision's
/// `rotate(interpolation=BILINEAR, expand=False)`; corners show `background`.
pub(crate) fn rotation(pictures: Tensor<4>, degrees: &[f32], background: [f32; 3]) -> Tensor<4> {
    let [b, c, h, w] = pictures.dims();
    let device = pictures.device();
    let radians = degrees.iter().map(|d| match d.abs() < SMALLEST_DEGREES {
        true => 0.0,
        false => f64::from(*d).to_radians(),
    });
    let radians: Vec<f64> = radians.collect();
    let cos = one_each(radians.iter().map(|r| r.cos() as f32), &device);
    let sin = one_each(radians.iter().map(|r| r.sin() as f32), &device);
    let (y, x) = (centred(h, &device).swap_dims(2, 3), centred(w, &device));
    let from_x = x.clone() * cos.clone() - y.clone() * sin.clone() + (w as f32 - 1.0) / 2.0;
    let from_y = x * sin + y * cos + (h as f32 - 1.0) / 2.0;
    let (taps_x, taps_y) = (taps(from_x, w), taps(from_y, h));

    let flat = pictures.reshape([b, c, h * w]);
    let mut sum: Option<Tensor<3>> = None;
    let mut covered: Option<Tensor<3>> = None;
    for [at_y, weight_y] in &taps_y {
        for [at_x, weight_x] in &taps_x {
            let at = (at_y.clone() * w as f32 + at_x.clone()).int().reshape([b, 1, h * w]);
            let weight = (weight_y.clone() * weight_x.clone()).reshape([b, 1, h * w]);
            let part = flat.clone().gather(2, at.repeat_dim(1, c)) * weight.clone();
            sum = Some(sum.map_or(part.clone(), |s| s + part));
            covered = Some(covered.map_or(weight.clone(), |s| s + weight));
        }
    }
    let background = Tensor::<3>::from_data(TensorData::new(background.to_vec(), [1, 3, 1]), &device);
    match (sum, covered) {
        (Some(sum), Some(covered)) => (sum + (-covered + 1.0) * background).reshape([b, c, h, w]),
        _ => flat.reshape([b, c, h, w]),
    }
}

/// Positions of pixels from the centre, `[1, 1, 1, side]`.
fn centred(side: usize, device: &Device) -> Tensor<4> {
    let middle = (side as f32 - 1.0) / 2.0;
    let values: Vec<f32> = (0..side).map(|i| i as f32 - middle).collect();
    Tensor::from_data(TensorData::new(values, [1, 1, 1, side]), device)
}

/// The two pixels on either side of positions along an axis, as whole numbers, with their weights; pixels that are not
/// there have weight 0 and the position of the nearest that is.
fn taps(from: Tensor<4>, side: usize) -> [[Tensor<4>; 2]; 2] {
    let low = from.clone().floor();
    let part = from - low.clone();
    let inside = |at: Tensor<4>, weight: Tensor<4>| {
        let clamped = at.clone().clamp(0.0, side as f32 - 1.0);
        // Whole numbers differ by 0 or by at least 1.
        let there = -(at - clamped.clone()).abs().clamp(0.0, 1.0) + 1.0;
        [clamped, weight * there]
    };
    [inside(low.clone(), -part.clone() + 1.0), inside(low + 1.0, part)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::*;

    const BACKGROUND: [f32; 3] = [0.9, 0.1, 0.4];

    /// Bilinear rotation pixel by pixel, in double precision.
    fn reference(picture: &[f32], h: usize, w: usize, degrees: f64) -> Vec<f32> {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let mut turned = Vec::new();
        for c in 0..3 {
            let value = |y: f64, x: f64| {
                let inside = y >= 0.0 && x >= 0.0 && y < h as f64 && x < w as f64;
                let at = || (c * h + y as usize) * w + x as usize;
                f64::from(if inside { picture[at()] } else { BACKGROUND[c] })
            };
            for i in 0..h {
                for j in 0..w {
                    let (my, mx) = ((h as f64 - 1.0) / 2.0, (w as f64 - 1.0) / 2.0);
                    let (y, x) = (i as f64 - my, j as f64 - mx);
                    let (y, x) = (sin * x + cos * y + my, cos * x - sin * y + mx);
                    let (top, left) = (y.floor(), x.floor());
                    let (fy, fx) = (y - top, x - left);
                    let upper = (1.0 - fx) * value(top, left) + fx * value(top, left + 1.0);
                    let lower = (1.0 - fx) * value(top + 1.0, left) + fx * value(top + 1.0, left + 1.0);
                    turned.push(((1.0 - fy) * upper + fy * lower) as f32);
                }
            }
        }
        turned
    }

    #[test]
    fn agrees_with_pixel_by_pixel() {
        let (h, w) = (13, 18);
        let input = random_pictures([2, 3, h, w], 1);
        let found = host(rotation(input.clone(), &[30.0, -7.5], BACKGROUND));
        let values = host(input);
        for (i, degrees) in [30.0, -7.5].into_iter().enumerate() {
            let part = i * 3 * h * w..(i + 1) * 3 * h * w;
            let expected = reference(&values[part.clone()], h, w, degrees);
            let furthest = found[part].iter().zip(&expected).map(|(f, e)| (f - e).abs());
            assert!(furthest.fold(0.0, f32::max) < 1e-4, "{degrees}");
        }
    }

    #[test]
    fn a_quarter_turns_counter_clockwise() {
        let picture: Vec<f32> = [0.1, 0.2, 0.3, 0.4].repeat(3);
        let found = host(rotation(pictures(&picture, [1, 3, 2, 2]), &[90.0], BACKGROUND));
        // 1 2     2 4
        // 3 4  to 1 3
        for (value, expected) in found.iter().zip([0.2, 0.4, 0.1, 0.3].repeat(3)) {
            assert!((value - expected).abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn a_gather_takes_no_pixel_more_than_twice() {
        let side = 96;
        for degrees in [0.001_f32, 0.5, 17.0, 30.0, 44.9, 45.0, 60.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let device = Device::flex();
            let (y, x) = (centred(side, &device).swap_dims(2, 3), centred(side, &device));
            let middle = (side as f32 - 1.0) / 2.0;
            let from_x = host((x.clone() * cos - y.clone() * sin + middle).floor());
            let from_y = host((x * sin + y * cos + middle).floor());
            let mut taken = std::collections::HashMap::new();
            for at in from_x.iter().zip(&from_y) {
                *taken.entry((*at.0 as i32, *at.1 as i32)).or_insert(0) += 1;
            }
            assert!(taken.values().all(|count| *count <= 2), "{degrees}");
        }
    }
}
