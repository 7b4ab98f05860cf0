//! Rasteriser for GPUs: CubeCL kernels on the wgpu device that burn uses.
use super::kernels::{SPLAT_FLOATS, composite, splat_gradients, sum_slots};
use super::tiles::TILE;
use super::uploads::{Uploaded, Uploads};
use super::{Drawing, PreparedView, Rasterizer};
use crate::error::{Error, Result};
use crate::memory::Limits;
use crate::picture::Picture;
use crate::quality::{batch, unbatch};
use burn::backend::Cube;
use burn::tensor::{DType, Device, Shape, Tensor};
use burn_cubecl::CubeDevice;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
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
    device: CubeDevice,
    name: String,
    uploads: Mutex<Uploads>,
}

impl GpuRasterizer {
    /// A rasteriser on `device`, which must be one that CubeCL computes on.
    ///
    /// # Errors
    /// [`Error::Device`] when it is another.
    pub fn new(device: &Device) -> Result<Self> {
        let probe = Tensor::<1>::zeros([1], &device.clone().inner());
        let probe = probe.try_into_primitive::<Cube>().map_err(|_| Error::Device {
            device: format!("{device:?}"),
            reason: "the GPU rasteriser needs a wgpu device".into(),
        })?;
        let name = probe.client.properties().identity.name.clone();
        Ok(GpuRasterizer {
            client: probe.client,
            device: probe.device,
            name: format!("wgpu ({name})"),
            uploads: Mutex::default(),
        })
    }

    /// Pictures of views of one size, `[views, 3, height, width]`, which stay on the device. Nothing is waited for.
    ///
    /// # Errors
    /// No views, sizes or colours that do not fit, or a buffer that the device cannot bind.
    pub fn draw(&self, drawings: &[Drawing<'_>]) -> Result<Tensor<4>> {
        let views: Vec<&PreparedView> = drawings.iter().map(|drawing| drawing.view).collect();
        let (width, height) = size_of_all(&views)?;
        let shape = [views.len(), 3, height as usize, width as usize];
        let len = shape.iter().product();
        self.check("pictures", 4 * len)?;
        let pictures = self.client.empty(4 * len);
        for (index, drawing) in drawings.iter().enumerate() {
            let Drawing { view, background, .. } = *drawing;
            view.check("colours", drawing.colours.len(), 3 * view.visible.len())?;
            let device = self.upload(view)?;
            let colours = self.buffer(bytemuck::cast_slice(drawing.colours));
            let (count, dim) = tile_grid(view);
            composite::launch(
                &self.client,
                count,
                dim,
                argument(&device.splats, view.splats.len() * SPLAT_FLOATS),
                argument(&device.start, view.tiles.start.len()),
                argument(&device.list, view.tiles.pairs()),
                argument(&colours, drawing.colours.len()),
                argument(&pictures, len),
                (index * view.picture_len()) as u32,
                width,
                height,
                background[0],
                background[1],
                background[2],
            );
        }
        let shape = Shape::from(shape.to_vec());
        let (client, device) = (self.client.clone(), self.device.clone());
        let pictures = CubeTensor::new_contiguous(client, device, shape, pictures, DType::F32);
        Ok(Tensor::from_primitive::<Cube>(pictures))
    }

    /// Takes a gradient to pictures of views (`[views, 3, height, width]`) back to their colours, and waits for it. What
    /// `also` holds comes back in the same transfer.
    ///
    /// # Errors
    /// Sizes that do not fit, or a failing device.
    pub fn draw_backward(
        &self,
        views: &[&PreparedView],
        gradient: Tensor<4>,
        also: Tensor<1>,
    ) -> Result<(Vec<Vec<f32>>, Vec<f32>)> {
        let (width, height) = size_of_all(views)?;
        let len = 3 * views.len() * width as usize * height as usize;
        let [gradient, also] = [self.primitive(gradient)?, self.primitive(also)?];
        if gradient.meta.num_elements() != len {
            return Err(self.failed("the gradient is not of these views"));
        }
        let mut handles = Vec::with_capacity(views.len() + 1);
        for (index, view) in views.iter().enumerate() {
            let visible = view.visible.len();
            let device = self.upload(view)?;
            let pairs = view.tiles.pairs();
            let slots = self.client.empty(12 * pairs.max(1));
            let (count, dim) = tile_grid(view);
            splat_gradients::launch(
                &self.client,
                count,
                dim,
                argument(&device.splats, view.splats.len() * SPLAT_FLOATS),
                argument(&device.start, view.tiles.start.len()),
                argument(&device.list, pairs),
                argument(&gradient.handle, len),
                argument(&slots, 3 * pairs),
                (index * view.picture_len()) as u32,
                width,
                height,
            );
            let out = self.client.empty(12 * visible.max(1));
            let cubes = (visible.max(1) as u32).div_ceil(CUBE);
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
            handles.push(out);
        }
        let lens = views.iter().map(|view| 3 * view.visible.len());
        let lens = lens.chain([also.meta.num_elements()]);
        handles.push(also.handle);
        let read = self
            .client
            .read(handles)
            .map_err(|e| self.failed(format_args!("{e:?}")))?;
        let mut values = Vec::with_capacity(read.len());
        for (bytes, len) in read.iter().zip(lens) {
            let mut numbers: Vec<f32> = bytemuck::pod_collect_to_vec(bytes);
            if numbers.len() < len {
                return Err(self.failed(format_args!("returned {} numbers instead of {len}", numbers.len())));
            }
            numbers.truncate(len);
            values.push(numbers);
        }
        let also = values.pop().unwrap_or_default();
        Ok((values, also))
    }

    fn primitive<const D: usize>(&self, tensor: Tensor<D>) -> Result<CubeTensor> {
        let tensor = tensor.try_into_primitive::<Cube>();
        Ok(into_contiguous(tensor.map_err(|e| self.failed(format_args!("{e:?}")))?))
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

    /// No buffer may be empty: of a view that shows nothing there is one number, which no kernel looks at.
    fn buffer(&self, bytes: &[u8]) -> Handle {
        match bytes {
            [] => self.client.create_from_slice(&[0; 4]),
            _ => self.client.create_from_slice(bytes),
        }
    }
}

/// A kernel argument: `len` elements of `handle`, or the one that stands for none.
#[allow(unsafe_code)]
fn argument(handle: &Handle, len: usize) -> BufferArg {
    // SAFETY: every caller passes the number of elements that the buffer was made with, and the kernels stay within it.
    unsafe { BufferArg::from_raw_parts(handle.clone(), len.max(1)) }
}

/// One cube a tile, one unit a pixel.
fn tile_grid(view: &PreparedView) -> (CubeCount, CubeDim) {
    (
        CubeCount::Static(view.tiles.columns, view.tiles.rows, 1),
        CubeDim::new_2d(TILE, TILE),
    )
}

/// Width and height that all views have.
fn size_of_all(views: &[&PreparedView]) -> Result<(u32, u32)> {
    let size = |view: &&PreparedView| (view.camera.width, view.camera.height);
    let first = views.first().map(size);
    match first.filter(|first| views.iter().all(|view| size(view) == *first)) {
        Some(size) => Ok(size),
        None => Err(Error::BadOption {
            field: "views",
            reason: "a batch has some, of one size".into(),
        }),
    }
}

impl Rasterizer for GpuRasterizer {
    fn name(&self) -> &str {
        &self.name
    }

    fn on_device(&self) -> Option<&GpuRasterizer> {
        Some(self)
    }

    fn render(&self, view: &PreparedView, colours: &[f32], background: [f32; 3]) -> Result<Picture> {
        let drawing = Drawing {
            view,
            colours,
            background,
        };
        Ok(unbatch(self.draw(&[drawing])?)?.swap_remove(0))
    }

    fn backward(&self, view: &PreparedView, picture_gradient: &[f32]) -> Result<Vec<f32>> {
        view.check("picture gradient", picture_gradient.len(), view.picture_len())?;
        let gradient = Picture {
            width: view.camera.width,
            height: view.camera.height,
            pixels: picture_gradient.to_vec(),
        };
        Ok(self.backward_all(&[view], &[gradient])?.swap_remove(0))
    }

    fn render_all(&self, drawings: &[Drawing<'_>]) -> Result<Vec<Picture>> {
        let size = |drawing: &Drawing<'_>| (drawing.view.camera.width, drawing.view.camera.height);
        let mut pictures = Vec::with_capacity(drawings.len());
        for same in drawings.chunk_by(|a, b| size(a) == size(b)) {
            pictures.extend(unbatch(self.draw(same)?)?);
        }
        Ok(pictures)
    }

    fn backward_all(&self, views: &[&PreparedView], gradients: &[Picture]) -> Result<Vec<Vec<f32>>> {
        let device = Device::from(self.device.clone());
        let pictures: Vec<&Picture> = gradients.iter().collect();
        let nothing = Tensor::zeros([1], &device);
        let (gradients, _) = self.draw_backward(views, batch(&pictures, &device)?, nothing)?;
        Ok(gradients)
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
