//! Rasteriser for GPUs: CubeCL kernels on the wgpu device that burn uses.
use super::kernels::{SPLAT_FLOATS, composite, splat_gradients, sum_slots};
use super::tiles::TILE;
use super::uploads::{Uploaded, Uploads};
use super::{PreparedView, Rasterizer};
use crate::error::{Error, Result};
use crate::memory::Limits;
use crate::picture::Picture;
use burn::backend::{BackendTensor, DispatchTensorKind};
use burn::tensor::{Device, Tensor};
use cubecl::prelude::*;
use cubecl::server::Handle;
use std::sync::{Mutex, PoisonError};

/// Units of a cube in kernels without tiles.
const CUBE: u32 = 256;
/// Cubes a dimension that every device allows.
const MAX_CUBES: u32 = 65_535;

/// Draws with CubeCL kernels; weights are recomputed at every use, so views need none cached.
pub struct GpuRasterizer {
    client: Client,
    name: String,
    uploads: Mutex<Uploads>,
}

impl GpuRasterizer {
    /// A rasteriser on `device`, which must be a wgpu device.
    ///
    /// # Errors
    /// [`Error::Device`] when it is another.
    pub fn new(device: &Device) -> Result<Self> {
        let probe = Tensor::<1>::zeros([1], &device.clone().inner());
        let DispatchTensorKind::Cube(BackendTensor::Float(tensor)) = probe.into_dispatch().kind else {
            return Err(Error::Device {
                device: format!("{device:?}"),
                reason: "the GPU rasteriser needs a wgpu device".into(),
            });
        };
        let client = tensor.client;
        let name = client.properties().identity.name.clone();
        Ok(GpuRasterizer {
            client,
            name: format!("wgpu ({name})"),
            uploads: Mutex::default(),
        })
    }

    fn failed(&self, reason: impl std::fmt::Display) -> Error {
        Error::Device {
            device: self.name.clone(),
            reason: reason.to_string(),
        }
    }

    /// Refuses a buffer that the device cannot bind, before anything is allocated. That is the scene's fault and not the
    /// device's: another attempt would end in the same way. An embedding draws a view before it begins, so there it is
    /// a matter of admission.
    fn check(&self, what: &str, bytes: usize) -> Result<()> {
        let limit = self.client.properties().memory.max_page_size;
        Limits::of_buffers(limit).admit_buffer(&format!("the buffer of a view's {what}"), bytes as u64)
    }

    fn upload(&self, view: &PreparedView) -> Result<Uploaded> {
        // A panic elsewhere cannot leave the list half changed.
        let mut uploads = self.uploads.lock().unwrap_or_else(PoisonError::into_inner);
        uploads.get_or_insert(view.id, || {
            let tiles = &view.tiles;
            self.check("splats", size_of_val(&view.splats[..]))?;
            self.check("gradient slots", 12 * tiles.pairs())?;
            self.check("pixels", 4 * view.picture_len())?;
            Ok(Uploaded {
                bytes: size_of_val(&view.splats[..]) + tiles.bytes(),
                splats: self.buffer(bytemuck::cast_slice(&view.splats)),
                start: self.buffer(bytemuck::cast_slice(&tiles.start)),
                list: self.buffer(bytemuck::cast_slice(&tiles.splats)),
                slot_start: self.buffer(bytemuck::cast_slice(&tiles.slot_start)),
                slots: self.buffer(bytemuck::cast_slice(&tiles.slots)),
            })
        })
    }

    fn buffer(&self, bytes: &[u8]) -> Handle {
        self.client.create_from_slice(bytes)
    }

    fn read(&self, handle: Handle, len: usize) -> Result<Vec<f32>> {
        let bytes = self
            .client
            .read_one(handle)
            .map_err(|e| self.failed(format_args!("{e:?}")))?;
        let values: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
        if values.len() < len {
            return Err(self.failed(format_args!("returned {} numbers instead of {len}", values.len())));
        }
        Ok(values[..len].to_vec())
    }
}

/// A kernel argument: `len` elements of `handle`.
#[allow(unsafe_code)]
fn argument(handle: &Handle, len: usize) -> BufferArg {
    // SAFETY: every caller passes the number of elements that the buffer was made with, and the kernels stay within it.
    unsafe { BufferArg::from_raw_parts(handle.clone(), len) }
}

/// One cube a tile, one unit a pixel.
fn tile_grid(view: &PreparedView) -> (CubeCount, CubeDim) {
    (
        CubeCount::Static(view.tiles.columns, view.tiles.rows, 1),
        CubeDim::new_2d(TILE, TILE),
    )
}

impl Rasterizer for GpuRasterizer {
    fn name(&self) -> &str {
        &self.name
    }

    fn render(&self, view: &PreparedView, colours: &[f32], background: [f32; 3]) -> Result<Picture> {
        view.check("colours", colours.len(), 3 * view.visible.len())?;
        let (width, height) = (view.camera.width, view.camera.height);
        let len = view.picture_len();
        if view.visible.is_empty() {
            // No buffer may be empty, and there is nothing to draw.
            let pixels = background.iter().copied().cycle().take(len).collect();
            return Ok(Picture { width, height, pixels });
        }
        let device = self.upload(view)?;
        let colour_buffer = self.buffer(bytemuck::cast_slice(colours));
        let picture = self.client.empty(4 * len);
        let (count, dim) = tile_grid(view);
        composite::launch(
            &self.client,
            count,
            dim,
            argument(&device.splats, view.splats.len() * SPLAT_FLOATS),
            argument(&device.start, view.tiles.start.len()),
            argument(&device.list, view.tiles.pairs()),
            argument(&colour_buffer, colours.len()),
            argument(&picture, len),
            width,
            height,
            background[0],
            background[1],
            background[2],
        );
        Ok(Picture {
            width,
            height,
            pixels: self.read(picture, len)?,
        })
    }

    fn backward(&self, view: &PreparedView, picture_gradient: &[f32]) -> Result<Vec<f32>> {
        view.check("picture gradient", picture_gradient.len(), view.picture_len())?;
        let visible = view.visible.len();
        if visible == 0 {
            return Ok(Vec::new());
        }
        let device = self.upload(view)?;
        let pairs = view.tiles.pairs();
        let gradient = self.buffer(bytemuck::cast_slice(picture_gradient));
        let slots = self.client.empty(12 * pairs);
        let (count, dim) = tile_grid(view);
        splat_gradients::launch(
            &self.client,
            count,
            dim,
            argument(&device.splats, view.splats.len() * SPLAT_FLOATS),
            argument(&device.start, view.tiles.start.len()),
            argument(&device.list, pairs),
            argument(&gradient, picture_gradient.len()),
            argument(&slots, 3 * pairs),
            view.camera.width,
            view.camera.height,
        );
        let out = self.client.empty(12 * visible);
        let cubes = (visible as u32).div_ceil(CUBE);
        let columns = cubes.min(MAX_CUBES);
        sum_slots::launch(
            &self.client,
            CubeCount::Static(columns, cubes.div_ceil(columns), 1),
            CubeDim::new_1d(CUBE),
            argument(&device.slot_start, visible + 1),
            argument(&device.slots, pairs),
            argument(&slots, 3 * pairs),
            argument(&out, 3 * visible),
            visible as u32,
        );
        self.read(out, 3 * visible)
    }
}

#[cfg(test)]
mod tests {
    use super::super::checks::{camera, conforms, scene};
    use super::super::{CpuRasterizer, WeightCache, prepare, sh};
    use super::*;
    use crate::device::{DeviceChoice, open};

    /// The Vulkan device, or `None` with a message where there is none; in CI that is a failure.
    fn device() -> Option<Device> {
        match open(DeviceChoice::Wgpu) {
            Ok(compute) => Some(compute.device),
            Err(error) => {
                assert!(std::env::var_os("CI").is_none(), "{error}");
                eprintln!("skipped: {error}");
                None
            }
        }
    }

    #[test]
    fn the_gpu_agrees_with_the_reference() {
        let Some(device) = device() else { return };
        let rasterizer = GpuRasterizer::new(&device).unwrap();
        conforms(&rasterizer, WeightCache::None);
        // Lists without the pairs that turned out to be hidden give the same picture.
        let (g, camera) = (scene(2000, 1), camera(75));
        let [all, pruned] = [WeightCache::None, WeightCache::Weights].map(|cache| {
            let view = prepare(&g, &camera, cache).unwrap();
            let picture = rasterizer
                .render(&view, &sh::colours(&g.sh, None, &view), [1.0; 3])
                .unwrap();
            (view.visible.len(), picture)
        });
        assert!(pruned.0 < all.0);
        assert_eq!(pruned.1, all.1);
    }

    #[test]
    fn the_gpu_repeats_itself_to_the_byte() {
        let Some(device) = device() else { return };
        let g = scene(1500, 0);
        let view = prepare(&g, &camera(64), WeightCache::None).unwrap();
        let colours = sh::colours(&g.sh, None, &view);
        let run = || {
            // A new rasteriser each time: the second run must not depend on buffers that the first left.
            let rasterizer = GpuRasterizer::new(&device).unwrap();
            let picture = rasterizer.render(&view, &colours, [0.0; 3]).unwrap();
            let gradient = rasterizer.backward(&view, &picture.pixels).unwrap();
            (picture, gradient)
        };
        let first = run();
        assert!(first.1.iter().any(|v| *v != 0.0));
        assert_eq!(first, run());
        assert_eq!(
            first.1.len(),
            CpuRasterizer.backward(&view, &first.0.pixels).unwrap().len()
        );
    }

    #[test]
    fn another_device_is_an_error() {
        let error = GpuRasterizer::new(&Device::flex()).err().map(|e| e.to_string());
        assert!(error.is_some_and(|e| e.contains("needs a wgpu device")));
    }
}
