//! What our own kernels on a card share: buffers, grids of cubes, and sums over a cube.
use burn::tensor::Shape;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;
use cubecl::server::Handle;

/// Units of a cube, where nothing else fits better.
pub(crate) const CUBE: u32 = 256;
const UNITS: usize = CUBE as usize;
/// Cubes a dimension that every device allows.
const MAX_CUBES: u32 = 65_535;

/// Numbers of 32 bits on a device. A clone is the same numbers.
#[derive(Clone, Debug)]
pub(crate) struct Buffer {
    pub handle: Handle,
    pub len: usize,
}

impl Buffer {
    /// Room for `len` numbers, which may be anything.
    pub fn empty(client: &Client, len: usize) -> Self {
        Self {
            handle: client.empty(4 * len.max(1)),
            len,
        }
    }

    /// `numbers`, of 4 bytes each. No buffer may be empty: where there are none there is one, which no kernel looks at.
    pub fn of<T: bytemuck::Pod>(client: &Client, numbers: &[T]) -> Self {
        let bytes: &[u8] = match numbers {
            [] => &[0; 4],
            _ => bytemuck::cast_slice(numbers),
        };
        Self {
            handle: client.create_from_slice(bytes),
            len: numbers.len(),
        }
    }

    /// `len` zeros.
    pub fn zeros(client: &Client, len: usize) -> Self {
        Self::of(client, &vec![0.0_f32; len])
    }

    /// The first `len` of them, at most as many as there are.
    pub fn first(&self, len: usize) -> Self {
        Self {
            handle: self.handle.clone(),
            len: len.min(self.len),
        }
    }

    /// As a kernel's argument.
    #[allow(unsafe_code)]
    pub fn argument(&self) -> BufferArg {
        // SAFETY: the buffer was made with that many numbers, and the kernels stay within them.
        unsafe { BufferArg::from_raw_parts(self.handle.clone(), self.len.max(1)) }
    }
}

/// A new tensor on the device of `like`, whose numbers may be anything.
pub(crate) fn empty_tensor(like: &CubeTensor, shape: Shape) -> CubeTensor {
    let handle = like.client.empty(shape.num_elements() * 4);
    CubeTensor::new_contiguous(like.client.clone(), like.device.clone(), shape, handle, like.dtype)
}

/// One unit for each of `units` in each of `layers`; kernels find theirs by [`unit_of_layer`], or of one layer by
/// `ABSOLUTE_POS`.
pub(crate) fn grid(units: usize, layers: usize) -> (CubeCount, CubeDim) {
    grid_of(units, layers, CUBE)
}

/// [`grid`] with cubes of so many units.
pub(crate) fn grid_of(units: usize, layers: usize, cube: u32) -> (CubeCount, CubeDim) {
    let (columns, rows) = columns_and_rows((units as u32).div_ceil(cube));
    (CubeCount::Static(columns, rows, layers as u32), CubeDim::new_1d(cube))
}

/// A cube for each of `count`; kernels find theirs by [`cube_of_layer`].
pub(crate) fn a_cube_each(count: usize) -> (CubeCount, CubeDim) {
    let (columns, rows) = columns_and_rows(count as u32);
    (CubeCount::Static(columns, rows, 1), CubeDim::new_1d(CUBE))
}

/// At least so many cubes, and one at least, as every device allows them.
pub(crate) fn columns_and_rows(cubes: u32) -> (u32, u32) {
    let columns = cubes.clamp(1, MAX_CUBES);
    (columns, cubes.div_ceil(columns).max(1))
}

/// Cubes of a layer of [`grid`].
pub(crate) fn cubes(units: usize) -> usize {
    let (columns, rows) = columns_and_rows((units as u32).div_ceil(CUBE));
    columns as usize * rows as usize
}

/// The number of a cube within its layer.
#[cube]
pub(crate) fn cube_of_layer() -> usize {
    (CUBE_POS_Y * CUBE_COUNT_X + CUBE_POS_X) as usize
}

/// The number of a unit within its layer.
#[cube]
pub(crate) fn unit_of_layer() -> usize {
    cube_of_layer() * CUBE as usize + UNIT_POS as usize
}

/// The sum of `value` over the [`CUBE`] units of a cube, which all get; always in the same order. `shared` has a place a unit.
#[cube]
pub(crate) fn sum_of_cube(value: f32, shared: &mut Shared<[f32]>) -> f32 {
    let unit = UNIT_POS as usize;
    shared[unit] = value;
    #[unroll]
    for level in 0..comptime!(UNITS.ilog2() as usize) {
        sync_cube();
        let half = comptime!(UNITS >> (level + 1));
        if unit < half {
            let other = shared[unit + half];
            shared[unit] += other;
        }
    }
    sync_cube();
    let sum = shared[0];
    // None may write the next sum while another has yet to read this one.
    sync_cube();
    sum
}
