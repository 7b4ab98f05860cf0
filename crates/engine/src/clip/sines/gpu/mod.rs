//! Mean sines on the GPU: CubeCL kernels on burn's buffers.
mod densities;
mod layout;
mod waves;

use burn::backend::{Cube, TensorMetadata};
use burn::tensor::Shape;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;

use self::densities::{chunk_counts, rarities, sums_of_chunks};
use self::layout::Sides;
use self::waves::{chunk_sums, means_of_chunks, means_of_squares, to_pixels, to_squares};
use super::density::{CORNERS, GRID};
use super::{FloatTensor, MeanSines, WeightedSines};
use crate::launch::{a_cube_each, empty_tensor, grid_of};

/// Units of a cube.
const CUBE: u32 = 64;
/// Squares that one unit adds up, or one cube has a unit for.
const CHUNK: usize = crate::launch::CUBE as usize;

/// Pictures as squares at all scales.
#[derive(Clone, Debug)]
struct Squares {
    /// As [`layout`] has them.
    numbers: CubeTensor,
    sides: Sides,
    views: usize,
    height: usize,
    width: usize,
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    squares: Squares,
    filters: CubeTensor,
    phases: CubeTensor,
    /// How rare the colour of each square is; none where all weigh alike.
    rarity: Option<CubeTensor>,
    /// One over the sum of weights, `[scales, views]`.
    shares: CubeTensor,
}

impl MeanSines for Cube {
    fn mean_sines(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        sides: Vec<usize>,
        equalization: f32,
    ) -> FloatTensor<Self> {
        Self::means(pictures, filters, phases, sides, equalization).0
    }
}

impl WeightedSines for Cube {
    type Kept = Kept;

    fn means(
        pictures: FloatTensor<Self>,
        filters: FloatTensor<Self>,
        phases: FloatTensor<Self>,
        sides: Vec<usize>,
        equalization: f32,
    ) -> (FloatTensor<Self>, Kept) {
        let [filters, phases] = [filters, phases].map(into_contiguous);
        let squares = Squares::of(into_contiguous(pictures), Sides::new(&sides));
        let rare = (equalization != 0.0).then(|| squares.rarity(equalization));
        let (waves, scales) = (phases.shape()[0], squares.sides.count);
        let sums = squares.room(&[squares.chunks() * waves / scales]);
        let (means, shares) = (
            squares.room(&[squares.views, waves]),
            squares.room(&[scales, squares.views]),
        );
        // Without weights nothing of these buffers is read.
        let [rarity, totals] = match &rare {
            Some([rarity, totals]) => [rarity, totals],
            None => [&phases; 2],
        };
        let [views, height, width] = squares.sizes();
        let client = &squares.numbers.client;
        let (count, dim) = grid_of(sums.shape()[0], 1, CUBE);
        chunk_sums::launch(
            client,
            count,
            dim,
            argument(&squares.numbers),
            argument(&filters),
            argument(&phases),
            argument(rarity),
            argument(&sums),
            views,
            width,
            height,
            squares.sides,
            rare.is_some(),
        );
        let (count, dim) = grid_of(squares.views * waves, 1, CUBE);
        means_of_chunks::launch(
            client,
            count,
            dim,
            argument(&sums),
            argument(totals),
            argument(&means),
            argument(&shares),
            views,
            width,
            height,
            squares.sides,
            rare.is_some(),
        );
        let kept = Kept {
            filters,
            phases,
            rarity: rare.map(|[rarity, _]| rarity),
            shares,
            squares,
        };
        (means, kept)
    }

    fn means_backward(kept: Kept, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        let (squares, gradient) = (&kept.squares, into_contiguous(gradient));
        let [views, height, width] = squares.sizes();
        let client = &squares.numbers.client;
        let of_squares = squares.room(&[squares.numbers.shape()[0]]);
        let (count, dim) = grid_of(of_squares.shape()[0] / 3, 1, CUBE);
        to_squares::launch(
            client,
            count,
            dim,
            argument(&squares.numbers),
            argument(&kept.filters),
            argument(&kept.phases),
            argument(kept.rarity.as_ref().unwrap_or(&kept.phases)),
            argument(&kept.shares),
            argument(&gradient),
            argument(&of_squares),
            views,
            width,
            height,
            squares.sides,
            kept.rarity.is_some(),
        );
        let out = squares.room(&[squares.views, 3, squares.height, squares.width]);
        let (count, dim) = grid_of(out.shape().num_elements(), 1, CUBE);
        to_pixels::launch(
            client,
            count,
            dim,
            argument(&of_squares),
            argument(&out),
            views,
            width,
            height,
            squares.sides,
        );
        out
    }
}

impl Squares {
    fn of(pictures: CubeTensor, sides: Sides) -> Self {
        let shape = pictures.shape();
        let (views, height, width) = (shape[0], shape[2], shape[3]);
        let len = 3 * views * sides.squares(height, width).sum::<usize>();
        let of = |numbers| Self {
            numbers,
            sides,
            views,
            height,
            width,
        };
        if sides == Sides::new(&[1]) {
            let client = pictures.client.clone();
            let (device, handle, dtype) = (pictures.device.clone(), pictures.handle.clone(), pictures.dtype);
            return of(CubeTensor::new_contiguous(
                client,
                device,
                Shape::new([len]),
                handle,
                dtype,
            ));
        }
        let squares = of(empty_tensor(&pictures, Shape::new([len])));
        let [views, height, width] = squares.sizes();
        let (count, dim) = grid_of(len / 3, 1, CUBE);
        means_of_squares::launch(
            &pictures.client,
            count,
            dim,
            argument(&pictures),
            argument(&squares.numbers),
            views,
            width,
            height,
            sides,
        );
        squares
    }

    /// How rare the colour of each square is, and the sum of that over each chunk.
    fn rarity(&self, equalization: f32) -> [CubeTensor; 2] {
        let chunks = self.chunks();
        let counts = self.room(&[chunks, GRID]);
        let grids = self.room(&[self.sides.count, self.views, GRID]);
        let (rarity, totals) = (self.room(&[self.numbers.shape()[0] / 3]), self.room(&[chunks]));
        let [views, height, width] = self.sizes();
        let client = &self.numbers.client;
        let (count, dim) = grid_of(chunks * GRID / CORNERS, 1, CUBE);
        chunk_counts::launch(
            client,
            count,
            dim,
            argument(&self.numbers),
            argument(&counts),
            views,
            width,
            height,
            self.sides,
        );
        let (count, dim) = grid_of(grids.shape().num_elements(), 1, CUBE);
        sums_of_chunks::launch(
            client,
            count,
            dim,
            argument(&counts),
            argument(&grids),
            views,
            width,
            height,
            self.sides,
        );
        let (count, dim) = a_cube_each(chunks);
        rarities::launch(
            client,
            count,
            dim,
            argument(&self.numbers),
            argument(&grids),
            argument(&rarity),
            argument(&totals),
            views,
            width,
            height,
            equalization,
            self.sides,
        );
        [rarity, totals]
    }

    /// Chunks of all views and scales.
    fn chunks(&self) -> usize {
        let of_view = self.sides.squares(self.height, self.width);
        self.views * of_view.map(|squares| squares.div_ceil(CHUNK)).sum::<usize>()
    }

    /// Views, height and width as kernels take them.
    fn sizes(&self) -> [u32; 3] {
        [self.views, self.height, self.width].map(|size| size as u32)
    }

    /// A new tensor where these are.
    fn room(&self, shape: &[usize]) -> CubeTensor {
        empty_tensor(&self.numbers, Shape::from(shape.to_vec()))
    }
}

fn argument(tensor: &CubeTensor) -> cubecl::prelude::BufferArg {
    tensor.clone().into_buffer_arg()
}
