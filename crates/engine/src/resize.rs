//! Antialiased bilinear resize, equal to torch's `interpolate(mode="bilinear", antialias=True, align_corners=False)`: of
//! tensors differentiably, and of pictures on the host.
use std::ops::Range;

use burn::tensor::{Device, Tensor, TensorData};

use crate::error::Result;
use crate::picture::Picture;
use crate::quality::comparable;

/// Resizes `[b, c, h, w]` to `[b, c, height, width]`.
///
/// Written as two products with fixed matrices, so it is differentiable and the same on every device.
pub fn resize(pictures: Tensor<4>, height: usize, width: usize) -> Tensor<4> {
    let [batch, channels, h, w] = pictures.dims();
    let device = pictures.device();
    let mut x = pictures;
    if w != width {
        // One product over all rows of all pictures.
        let flat = x
            .reshape([batch * channels * h, w])
            .matmul(matrix(w, width, &device).transpose());
        x = flat.reshape([batch, channels, h, width]);
    }
    if h != height {
        x = matrix(h, height, &device).unsqueeze::<4>().matmul(x);
    }
    x
}

/// A picture at another size, as [`resize`] makes it, without the inputs that contribute nothing: of 800 pixels made 160 that
/// is a hundredth of the products. What is plain stays exactly as it is: the others' differences from the first input are
/// averaged.
///
/// # Errors
/// A picture without pixels, or whose pixels are not as many as its size says.
pub fn resized(picture: &Picture, height: usize, width: usize) -> Result<Picture> {
    let whole = [0..picture.width as usize, 0..picture.height as usize];
    resized_part(picture, whole, height, width)
}

/// [`resized`] of these columns and rows of a picture.
///
/// # Errors
/// Those of [`resized`]; the part must lie within the picture, and have pixels.
pub fn resized_part(
    picture: &Picture,
    [columns, rows]: [Range<usize>; 2],
    height: usize,
    width: usize,
) -> Result<Picture> {
    comparable(&[picture])?;
    let row = 3 * columns.len();
    let line = |y: usize| &picture.pixels[3 * ((rows.start + y) * picture.width as usize + columns.start)..][..row];
    let mut squashed = vec![0.0; height * row];
    for (out, inputs) in squashed.chunks_exact_mut(row).zip(axis(rows.len(), height)) {
        let first = line(inputs.first);
        out.copy_from_slice(first);
        for (i, weight) in inputs.weights.iter().enumerate().skip(1) {
            let values = line(inputs.first + i).iter().zip(first);
            out.iter_mut()
                .zip(values)
                .for_each(|(out, (v, first))| *out += weight * (v - first));
        }
    }
    let columns: Vec<Inputs> = axis(columns.len(), width).collect();
    let mut pixels = vec![[0.0_f32; 3]; height * width];
    for (out, row) in pixels.chunks_exact_mut(width.max(1)).zip(squashed.chunks_exact(row)) {
        for (out, inputs) in out.iter_mut().zip(&columns) {
            let colours = &row.as_chunks::<3>().0[inputs.first..];
            let first = colours[0];
            *out = first;
            for (weight, colour) in inputs.weights.iter().zip(colours).skip(1) {
                (0..3).for_each(|c| out[c] += weight * (colour[c] - first[c]));
            }
        }
    }
    Ok(Picture {
        width: width as u32,
        height: height as u32,
        pixels: pixels.into_flattened(),
    })
}

/// What contributes to an output along one axis: inputs from the first on, and how much each does.
struct Inputs {
    first: usize,
    weights: Vec<f32>,
}

/// Those of each output. A triangle filter, widened by the scale when shrinking (torch's `_upsample_bilinear2d_aa`).
fn axis(from: usize, to: usize) -> impl Iterator<Item = Inputs> {
    let scale = from as f64 / to as f64;
    let support = scale.max(1.0);
    (0..to).map(move |i| {
        let centre = scale * (i as f64 + 0.5);
        let first = (centre - support + 0.5).max(0.0) as usize;
        let last = ((centre + support + 0.5) as usize).min(from);
        let triangle = |j: usize| (1.0 - ((j as f64 - centre + 0.5) / support).abs()).max(0.0);
        let total: f64 = (first..last).map(triangle).sum();
        Inputs {
            first,
            weights: (first..last).map(|j| (triangle(j) / total) as f32).collect(),
        }
    })
}

/// `[to, from]`: how much each input contributes to each output along one axis.
fn matrix(from: usize, to: usize, device: &Device) -> Tensor<2> {
    let mut matrix = vec![0.0f32; to * from];
    for (row, inputs) in matrix.chunks_exact_mut(from).zip(axis(from, to)) {
        row[inputs.first..][..inputs.weights.len()].copy_from_slice(&inputs.weights);
    }
    Tensor::from_data(TensorData::new(matrix, [to, from]), device)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::{batch, unbatch};

    fn values(t: Tensor<4>) -> Vec<f32> {
        t.into_data().iter::<f32>().collect()
    }

    #[test]
    fn weights_of_every_output_sum_to_one() {
        for (from, to) in [(800, 224), (224, 224), (5, 224), (1, 7), (7, 1), (225, 224)] {
            let sums = matrix(from, to, &Device::flex()).sum_dim(1).into_data();
            assert!(sums.iter::<f32>().all(|s| (s - 1.0).abs() < 1e-5), "{from} to {to}");
        }
    }

    #[test]
    fn halving_averages_with_the_triangle_filter() {
        // torch.nn.functional.interpolate(arange(8).float().view(1, 1, 1, 8), (1, 4), mode="bilinear", antialias=True)
        let x = Tensor::<1>::from_floats([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], &Device::flex());
        let found = values(resize(x.reshape([1, 1, 1, 8]), 1, 4));
        for (found, expected) in found.iter().zip([0.7142857, 2.5, 4.5, 6.2857146]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn what_is_plain_stays_exactly_so_and_a_part_is_a_picture_of_its_own() {
        let value = |i: u32| if i % 83 < 40 { 0.7 } else { (i as f32 * 0.37).sin() };
        let picture = Picture {
            width: 83,
            height: 61,
            pixels: (0..83 * 61).flat_map(|i| [value(i), 0.3, value(i)]).collect(),
        };
        let plain = resized_part(&picture, [3..40, 5..61], 16, 16).unwrap();
        assert!(
            plain
                .pixels
                .as_chunks::<3>()
                .0
                .iter()
                .all(|pixel| *pixel == [0.7, 0.3, 0.7])
        );
        let [columns, rows] = [20..71, 9..50];
        let line = |y: usize| &picture.pixels[3 * (y * 83 + columns.start)..3 * (y * 83 + columns.end)];
        let crop = Picture {
            width: columns.len() as u32,
            height: rows.len() as u32,
            pixels: rows.clone().flat_map(line).copied().collect(),
        };
        let part = resized_part(&picture, [columns.clone(), rows.clone()], 16, 12).unwrap();
        assert_eq!(part, resized(&crop, 16, 12).unwrap());
    }

    #[test]
    fn a_picture_is_resized_as_tensors_are() {
        let of = |width: u32, height: u32| Picture {
            width,
            height,
            pixels: (0..3 * width * height)
                .map(|i| 0.5 + 0.5 * (i as f32 * 0.71).sin())
                .collect(),
        };
        for (picture, height, width) in [
            (of(80, 57), 16, 16),
            (of(7, 9), 20, 11),
            (of(16, 33), 16, 16),
            (of(1, 1), 3, 2),
        ] {
            let tensors = resize(batch(&[&picture], &Device::flex()).unwrap(), height, width);
            let expected = unbatch(tensors).unwrap().swap_remove(0);
            let found = resized(&picture, height, width).unwrap();
            assert_eq!((found.width, found.height), (expected.width, expected.height));
            for (found, expected) in found.pixels.iter().zip(&expected.pixels) {
                assert!((found - expected).abs() < 1e-6, "{found} {expected}");
            }
        }
        assert!(resized(&of(0, 5), 4, 4).is_err());
    }
}
