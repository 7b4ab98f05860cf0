//! Mean sines on the GPU: CubeCL kernels on burn's buffers.
mod densities;
mod waves;

use burn::backend::ops::ModuleOps;
use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

use self::densities::{chunk_counts, chunk_totals, rarities, shares_of_all};
use self::waves::{chunk_sums, mean_of_chunks, to_pixels};
use super::density::{CORNERS, GRID};
use super::{FloatTensor, MeanSines, WeightedSines};
use crate::launch::{empty_tensor, grid_of};

/// Units of a cube.
const CUBE: u32 = 64;
/// Pixels that one unit adds up.
const CHUNK: usize = 256;

impl MeanSines for Cube {
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

impl WeightedSines for Cube {
    fn weights(pictures: FloatTensor<Self>, side: usize, equalization: f32) -> Option<FloatTensor<Self>> {
        if equalization == 0.0 {
            return None;
        }
        let pictures = into_contiguous(averaged(pictures, side));
        let shape = pictures.shape();
        let (views, pixels) = (shape[0], shape[2] * shape[3]);
        let chunks = pixels.div_ceil(CHUNK);
        let client = pictures.client.clone();
        let new = |shape: &[usize]| empty_tensor(&pictures, Shape::from(shape.to_vec()));
        let counts = new(&[views, chunks, GRID]);
        let grid_of_colours = new(&[views, GRID]);
        let rarity = new(&[views, pixels]);
        let totals = new(&[views, chunks]);
        let weights = new(&[views, pixels]);
        let (pixels, chunks) = (pixels as u32, chunks as u32);
        let arg = |tensor: &CubeTensor| tensor.clone().into_buffer_arg();
        let (count, dim) = grid_of(counts.shape().num_elements() / CORNERS, 1, CUBE);
        chunk_counts::launch(&client, count, dim, arg(&pictures), arg(&counts), pixels, chunks);
        let (count, dim) = grid_of(views * GRID, 1, CUBE);
        mean_of_chunks::launch(
            &client,
            count,
            dim,
            arg(&counts),
            arg(&grid_of_colours),
            GRID as u32,
            chunks,
            1.0,
        );
        let (count, dim) = grid_of(views * pixels as usize, 1, CUBE);
        rarities::launch(
            &client,
            count,
            dim,
            arg(&pictures),
            arg(&grid_of_colours),
            arg(&rarity),
            pixels,
            equalization,
        );
        let (count, dim) = grid_of(views * chunks as usize, 1, CUBE);
        chunk_totals::launch(&client, count, dim, arg(&rarity), arg(&totals), pixels, chunks);
        let (count, dim) = grid_of(views * pixels as usize, 1, CUBE);
        shares_of_all::launch(
            &client,
            count,
            dim,
            arg(&rarity),
            arg(&totals),
            arg(&weights),
            pixels,
            chunks,
        );
        Some(weights)
    }

    fn sums(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        weights: Option<FloatTensor<Self>>,
        side: usize,
    ) -> FloatTensor<Self> {
        let [pictures, filters, phases] = [averaged(pictures, side), filters, phases].map(into_contiguous);
        let weighted = weights.is_some();
        // Without weights nothing of the buffer is read.
        let weights = weights.map_or_else(|| phases.clone(), into_contiguous);
        let shape = pictures.shape();
        let (views, waves) = (shape[0], phases.shape()[0]);
        let pixels = shape[2] * shape[3];
        let chunks = pixels.div_ceil(CHUNK);
        let client = pictures.client.clone();
        let sums = empty_tensor(&pictures, Shape::new([views, chunks, waves]));
        let means = empty_tensor(&pictures, Shape::new([views, waves]));
        let (count, dim) = grid_of(views * chunks * waves, 1, CUBE);
        chunk_sums::launch(
            &client,
            count,
            dim,
            pictures.into_buffer_arg(),
            filters.into_buffer_arg(),
            phases.into_buffer_arg(),
            weights.into_buffer_arg(),
            sums.clone().into_buffer_arg(),
            pixels as u32,
            chunks as u32,
            weighted,
        );
        let (count, dim) = grid_of(views * waves, 1, CUBE);
        let scale = if weighted { 1.0 } else { 1.0 / pixels as f32 };
        let (sums, out) = (sums.into_buffer_arg(), means.clone().into_buffer_arg());
        mean_of_chunks::launch(&client, count, dim, sums, out, waves as u32, chunks as u32, scale);
        means
    }

    fn sums_backward(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        weights: Option<FloatTensor<Self>>,
        gradient: FloatTensor<Self>,
        side: usize,
    ) -> FloatTensor<Self> {
        let all = pictures.clone();
        let tensors = [averaged(pictures, side), filters, phases, gradient];
        let [pictures, filters, phases, gradient] = tensors.map(into_contiguous);
        let weighted = weights.is_some();
        let weights = weights.map_or_else(|| phases.clone(), into_contiguous);
        let shape = pictures.shape();
        let pixels = shape[2] * shape[3];
        let client = pictures.client.clone();
        let out = empty_tensor(&pictures, shape.clone());
        let (count, dim) = grid_of(shape[0] * pixels, 1, CUBE);
        to_pixels::launch(
            &client,
            count,
            dim,
            pictures.into_buffer_arg(),
            filters.into_buffer_arg(),
            phases.into_buffer_arg(),
            weights.into_buffer_arg(),
            gradient.into_buffer_arg(),
            out.clone().into_buffer_arg(),
            pixels as u32,
            1.0 / pixels as f32,
            weighted,
        );
        match side {
            1 => out,
            n => Self::avg_pool2d_backward(all, out, [n; 2], [n; 2], [0; 2], true, false),
        }
    }
}

/// Means of squares of pictures.
fn averaged(pictures: CubeTensor, side: usize) -> CubeTensor {
    match side {
        1 => pictures,
        n => Cube::avg_pool2d(pictures, [n; 2], [n; 2], [0; 2], true, false),
    }
}
