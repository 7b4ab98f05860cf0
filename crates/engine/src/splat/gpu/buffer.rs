//! Buffers on a device with how many numbers of 32 bits they hold.
use cubecl::prelude::*;
use cubecl::server::Handle;

/// Units of a cube in kernels without tiles.
pub(crate) const CUBE: u32 = 256;
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

    /// As a kernel's argument.
    #[allow(unsafe_code)]
    pub fn argument(&self) -> BufferArg {
        // SAFETY: the buffer was made with that many numbers, and the kernels stay within them.
        unsafe { BufferArg::from_raw_parts(self.handle.clone(), self.len.max(1)) }
    }
}

/// One unit for each of `units` in each of `layers`; kernels find theirs by [`unit_of_layer`].
pub(crate) fn grid(units: usize, layers: usize) -> (CubeCount, CubeDim) {
    let cubes = (units as u32).div_ceil(CUBE).max(1);
    let columns = cubes.min(MAX_CUBES);
    (
        CubeCount::Static(columns, cubes.div_ceil(columns), layers as u32),
        CubeDim::new_1d(CUBE),
    )
}

/// Cubes of a layer of [`grid`].
pub(crate) fn cubes(units: usize) -> usize {
    let cubes = (units as u32).div_ceil(CUBE).max(1);
    let columns = cubes.min(MAX_CUBES);
    (cubes.div_ceil(columns) * columns) as usize
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
