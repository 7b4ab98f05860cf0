//! Mean sines on the GPU: CubeCL kernels on burn's buffers.
mod densities;
mod waves;

use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

use self::densities::{chunk_counts, rarities, sums_of_chunks};
use self::waves::{chunk_sums, means_of_chunks, means_of_squares, to_pixels};
use super::density::{CORNERS, GRID};
use super::{FloatTensor, MeanSines, WeightedSines};
use crate::launch::{a_cube_each, empty_tensor, grid_of};

/// Units of a cube.
const CUBE: u32 = 64;
/// Pixels that one unit adds up, or one cube has a unit for.
const CHUNK: usize = crate::launch::CUBE as usize;

/// What the backward pass needs.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    squares: CubeTensor,
    filters: CubeTensor,
    phases: CubeTensor,
    /// How rare the colour of each square is, `[views, squares]`; none where all weigh alike.
    rarity: Option<CubeTensor>,
    /// One over the sum of a view's weights, `[views]`.
    shares: CubeTensor,
    /// Of the pictures.
    height: usize,
    width: usize,
    side: usize,
}

impl MeanSines for Cube {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
        equalization: f32,
    ) -> FloatTensor<Self> {
        Self::means(pictures, filters, phases, side, equalization).0
    }
}

impl WeightedSines for Cube {
    type Kept = Kept;

    fn means(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        side: usize,
        equalization: f32,
    ) -> (FloatTensor<Self>, Kept) {
        let [pictures, filters, phases] = [pictures, filters, phases].map(into_contiguous);
        let shape = pictures.shape();
        let (views, height, width) = (shape[0], shape[2], shape[3]);
        let squares = averaged(pictures, side);
        let (pixels, waves) = ((height / side) * (width / side), phases.shape()[0]);
        let chunks = pixels.div_ceil(CHUNK);
        let rare = (equalization != 0.0).then(|| rarity(&squares, equalization));
        let client = squares.client.clone();
        let new = |shape: &[usize]| empty_tensor(&squares, Shape::from(shape.to_vec()));
        let (sums, means, shares) = (new(&[views, chunks, waves]), new(&[views, waves]), new(&[views]));
        // Without weights nothing of these buffers is read.
        let [rarity, totals] = match &rare {
            Some([rarity, totals]) => [rarity, totals],
            None => [&phases; 2],
        };
        let (count, dim) = grid_of(views * chunks * waves, 1, CUBE);
        chunk_sums::launch(
            &client,
            count,
            dim,
            argument(&squares),
            argument(&filters),
            argument(&phases),
            argument(rarity),
            argument(&sums),
            pixels as u32,
            chunks as u32,
            rare.is_some(),
        );
        let (count, dim) = grid_of(views * waves, 1, CUBE);
        means_of_chunks::launch(
            &client,
            count,
            dim,
            argument(&sums),
            argument(totals),
            argument(&means),
            argument(&shares),
            waves as u32,
            pixels as u32,
            chunks as u32,
            rare.is_some(),
        );
        let kept = Kept {
            squares,
            filters,
            phases,
            rarity: rare.map(|[rarity, _]| rarity),
            shares,
            height,
            width,
            side,
        };
        (means, kept)
    }

    fn means_backward(kept: Kept, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        let gradient = into_contiguous(gradient);
        let (views, pixels) = (
            kept.squares.shape()[0],
            (kept.height / kept.side) * (kept.width / kept.side),
        );
        let out = empty_tensor(&kept.squares, Shape::new([views, 3, kept.height, kept.width]));
        let (count, dim) = grid_of(views * pixels, 1, CUBE);
        to_pixels::launch(
            &kept.squares.client,
            count,
            dim,
            argument(&kept.squares),
            argument(&kept.filters),
            argument(&kept.phases),
            argument(kept.rarity.as_ref().unwrap_or(&kept.phases)),
            argument(&kept.shares),
            argument(&gradient),
            argument(&out),
            kept.width as u32,
            kept.height as u32,
            kept.side as u32,
            kept.rarity.is_some(),
        );
        out
    }
}

/// How rare the colours of pixels are, `[views, pixels]`, and the sum of that over chunks, `[views, chunks]`.
fn rarity(pictures: &CubeTensor, equalization: f32) -> [CubeTensor; 2] {
    let shape = pictures.shape();
    let (views, pixels) = (shape[0], shape[2] * shape[3]);
    let chunks = pixels.div_ceil(CHUNK);
    let client = &pictures.client;
    let new = |shape: &[usize]| empty_tensor(pictures, Shape::from(shape.to_vec()));
    let counts = new(&[views, chunks, GRID]);
    let grid_of_colours = new(&[views, GRID]);
    let (rarity, totals) = (new(&[views, pixels]), new(&[views, chunks]));
    let (count, dim) = grid_of(views * chunks * GRID / CORNERS, 1, CUBE);
    let (pixels, in_chunks) = (pixels as u32, chunks as u32);
    chunk_counts::launch(
        client,
        count,
        dim,
        argument(pictures),
        argument(&counts),
        pixels,
        in_chunks,
    );
    let (count, dim) = grid_of(views * GRID, 1, CUBE);
    sums_of_chunks::launch(
        client,
        count,
        dim,
        argument(&counts),
        argument(&grid_of_colours),
        GRID as u32,
        in_chunks,
    );
    let (count, dim) = a_cube_each(views * chunks);
    rarities::launch(
        client,
        count,
        dim,
        argument(pictures),
        argument(&grid_of_colours),
        argument(&rarity),
        argument(&totals),
        pixels,
        in_chunks,
        equalization,
    );
    [rarity, totals]
}

/// Means of squares of pictures.
fn averaged(pictures: CubeTensor, side: usize) -> CubeTensor {
    if side == 1 {
        return pictures;
    }
    let shape = pictures.shape();
    let (height, width) = (shape[2], shape[3]);
    let out = empty_tensor(&pictures, Shape::new([shape[0], shape[1], height / side, width / side]));
    let (count, dim) = grid_of(out.shape().num_elements(), 1, CUBE);
    means_of_squares::launch(
        &pictures.client,
        count,
        dim,
        argument(&pictures),
        argument(&out),
        width as u32,
        height as u32,
        side as u32,
    );
    out
}

fn argument(tensor: &CubeTensor) -> cubecl::prelude::BufferArg {
    tensor.clone().into_buffer_arg()
}
