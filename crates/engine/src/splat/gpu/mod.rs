//! Rasteriser for GPUs: CubeCL kernels on the wgpu device that burn uses.
mod batch;
mod buffer;
mod harmonics;
mod kernels;
mod scene;
mod uploads;

use std::sync::{Mutex, MutexGuard, PoisonError};

use burn::backend::Cube;
use burn::tensor::{Bytes, DType, Device, Shape, Tensor};
use burn_cubecl::CubeDevice;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use self::kernels::{composite, splat_gradients, sum_slots};
use self::uploads::Uploads;
use super::tiles::TILE;
use super::{Drawing, PreparedView, Rasterizer};
use crate::error::{Error, Result};
use crate::picture::Picture;
use crate::quality::unbatch;

pub(crate) use self::batch::{Batch, Group, PackedView, Shown};
pub(crate) use self::buffer::{Buffer, CUBE, cube_of_layer, cubes, grid, unit_of_layer};
pub(crate) use self::scene::{Chunk, SceneOnDevice};

/// Draws with CubeCL kernels; weights are recomputed at every use, so views need none cached.
pub struct GpuRasterizer {
    client: Client,
    device: CubeDevice,
    name: String,
    uploads: Mutex<Uploads>,
    /// Bytes of the largest buffer.
    limit: u64,
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
            limit: probe.client.properties().memory.max_page_size,
            client: probe.client,
            device: probe.device,
            name: format!("wgpu ({name})"),
            uploads: Mutex::default(),
        })
    }

    /// What launches kernels.
    pub(crate) fn client(&self) -> &Client {
        &self.client
    }

    /// Bytes of the largest buffer.
    pub(crate) fn limit(&self) -> u64 {
        self.limit
    }

    /// Puts views of one size side by side on the device.
    ///
    /// # Errors
    /// No views, different sizes, or a view with a buffer that the device cannot bind. That is the scene's fault and not the
    /// device's: another attempt would end in the same way. An embedding draws a view before it begins, so there it is
    /// a matter of admission.
    pub(crate) fn batch(&self, views: &[Shown<'_>]) -> Result<Batch> {
        let (width, height) = size_of_all(views)?;
        let groups = batch::groups(views, self.limit)?;
        let uploaded: Vec<Buffer> = views.iter().map(|shown| self.upload(shown.view)).collect();
        let group = |range: std::ops::Range<usize>| batch::group(&self.client, range.clone(), views, &uploaded[range]);
        Ok(Batch {
            groups: groups.into_iter().map(group).collect(),
            views: views.len(),
            width,
            height,
        })
    }

    /// Pictures of views, `[views, 3, height, width]`, which stay on the device, with the `colours` of each group. Nothing
    /// is waited for.
    ///
    /// # Errors
    /// Pictures that take more than a buffer.
    pub(crate) fn composite(&self, batch: &Batch, colours: &[Buffer]) -> Result<Tensor<4>> {
        let shape = [batch.views, 3, batch.height as usize, batch.width as usize];
        let len: usize = shape.iter().product();
        let limits = crate::memory::Limits::of_buffers(self.limit);
        limits.admit_buffer("the buffer of a batch's pictures", 4 * len as u64)?;
        let pictures = Buffer::empty(&self.client, len);
        for (group, colours) in batch.groups.iter().zip(colours) {
            let (count, dim) = tile_grid(group);
            composite::launch(
                &self.client,
                count,
                dim,
                group.words.argument(),
                group.table.argument(),
                colours.argument(),
                pictures.argument(),
                batch.width,
                batch.height,
            );
        }
        let shape = Shape::from(shape.to_vec());
        let (client, device) = (self.client.clone(), self.device.clone());
        let pictures = CubeTensor::new_contiguous(client, device, shape, pictures.handle, DType::F32);
        Ok(Tensor::from_primitive::<Cube>(pictures))
    }

    /// What a gradient to pictures (`[views, 3, height, width]`) means for each slot of each group, `[pairs][3]`. Nothing is
    /// waited for.
    ///
    /// # Errors
    /// A gradient of another size, or that is not on the device.
    pub(crate) fn slot_gradients(&self, batch: &Batch, gradient: Tensor<4>) -> Result<Vec<Buffer>> {
        let gradient = self.buffer_of(gradient)?;
        if gradient.len != 3 * batch.views * batch.width as usize * batch.height as usize {
            return Err(self.failed("the gradient is not of these views"));
        }
        let of_group = |group: &Group| {
            let slots = Buffer::empty(&self.client, 3 * group.pairs);
            let (count, dim) = tile_grid(group);
            splat_gradients::launch(
                &self.client,
                count,
                dim,
                group.words.argument(),
                group.table.argument(),
                gradient.argument(),
                slots.argument(),
                batch.width,
                batch.height,
            );
            slots
        };
        Ok(batch.groups.iter().map(of_group).collect())
    }

    /// Pictures of views with colours of the host, on the device.
    fn draw(&self, drawings: &[Drawing<'_>]) -> Result<Tensor<4>> {
        let shown: Vec<Shown<'_>> = drawings.iter().map(Shown::from).collect();
        for Drawing { view, colours, .. } in drawings {
            view.check("colours", colours.len(), 3 * view.visible.len())?;
        }
        let batch = self.batch(&shown)?;
        let of_group = |group: &Group| {
            let parts = drawings[group.views.clone()].iter().map(|drawing| drawing.colours);
            Buffer::of(&self.client, &parts.collect::<Vec<_>>().concat())
        };
        let colours: Vec<Buffer> = batch.groups.iter().map(of_group).collect();
        self.composite(&batch, &colours)
    }

    /// Takes gradients to pictures of views of one size back to their colours, and waits for them.
    fn draw_backward(&self, views: &[&PreparedView], gradient: Tensor<4>) -> Result<Vec<Vec<f32>>> {
        let background = [0.0; 3];
        let shown: Vec<Shown<'_>> = views.iter().map(|&view| Shown { view, background }).collect();
        let batch = self.batch(&shown)?;
        let slots = self.slot_gradients(&batch, gradient)?;
        let sums = batch.groups.iter().zip(&slots).map(|(group, slots)| {
            let out = Buffer::empty(&self.client, 3 * group.colours());
            let (count, dim) = grid(group.most_visible(), group.views.len());
            sum_slots::launch(
                &self.client,
                count,
                dim,
                group.words.argument(),
                group.table.argument(),
                slots.argument(),
                out.argument(),
            );
            out
        });
        let of_groups = self.read(&sums.collect::<Vec<_>>())?;
        let mut gradients = Vec::with_capacity(views.len());
        for (group, numbers) in batch.groups.iter().zip(of_groups) {
            let mut rest = &numbers[..];
            for visible in &group.visible {
                let own;
                (own, rest) = rest.split_at(3 * visible);
                gradients.push(own.to_vec());
            }
        }
        Ok(gradients)
    }

    /// The numbers of some buffers, in one transfer. Waits for all that was launched.
    ///
    /// # Errors
    /// A failing device.
    pub(crate) fn read(&self, buffers: &[Buffer]) -> Result<Vec<Vec<f32>>> {
        let handles = buffers.iter().map(|buffer| buffer.handle.clone()).collect();
        let read = self.client.read(handles);
        let read = read.map_err(|e| self.failed(format_args!("{e:?}")))?;
        let numbers = read.iter().zip(buffers).map(|(bytes, Buffer { len, .. })| {
            let mut numbers: Vec<f32> = bytemuck::pod_collect_to_vec(bytes);
            if numbers.len() < *len {
                return Err(self.failed(format_args!("returned {} numbers instead of {len}", numbers.len())));
            }
            numbers.truncate(*len);
            Ok(numbers)
        });
        numbers.collect()
    }

    /// A tensor's numbers, in order.
    ///
    /// # Errors
    /// One that is not on the device.
    pub(crate) fn buffer_of<const D: usize>(&self, tensor: Tensor<D>) -> Result<Buffer> {
        let tensor = tensor.try_into_primitive::<Cube>();
        let tensor = into_contiguous(tensor.map_err(|e| self.failed(format_args!("{e:?}")))?);
        Ok(Buffer {
            len: tensor.meta.num_elements(),
            handle: tensor.handle,
        })
    }

    fn failed(&self, reason: impl std::fmt::Display) -> Error {
        Error::Device {
            device: self.name.clone(),
            reason: reason.to_string(),
        }
    }

    /// Sends a view ahead of its use. Nothing is waited for.
    pub(crate) fn send(&self, view: &PreparedView, packed: PackedView) {
        self.uploads().get_or_insert(view.id, || self.words(packed));
    }

    fn upload(&self, view: &PreparedView) -> Buffer {
        self.uploads()
            .get_or_insert(view.id, || self.words(PackedView::new(view)))
    }

    fn uploads(&self) -> MutexGuard<'_, Uploads> {
        // A panic elsewhere cannot leave the list half changed.
        self.uploads.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn words(&self, PackedView(words): PackedView) -> Buffer {
        let len = words.len();
        let handle = self.client.create(Bytes::from_elems(words));
        Buffer { handle, len }
    }
}

/// One cube a tile of each view, one unit a pixel.
fn tile_grid(group: &Group) -> (CubeCount, CubeDim) {
    (
        CubeCount::Static(group.tile_columns, group.tile_rows, group.views.len() as u32),
        CubeDim::new_2d(TILE, TILE),
    )
}

/// Width and height that all views have.
fn size_of_all(views: &[Shown<'_>]) -> Result<(u32, u32)> {
    let size = |shown: &Shown<'_>| (shown.view.camera.width, shown.view.camera.height);
    let first = views.first().map(size);
    match first.filter(|first| views.iter().all(|view| size(view) == *first)) {
        Some(size) => Ok(size),
        None => Err(Error::BadOption {
            field: "views",
            reason: "a batch has some, of one size".into(),
        }),
    }
}

impl<'a> From<&Drawing<'a>> for Shown<'a> {
    fn from(drawing: &Drawing<'a>) -> Self {
        Self {
            view: drawing.view,
            background: drawing.background,
        }
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
        self.draw_backward(views, crate::quality::batch(&pictures, &device)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{DeviceChoice, open};
    use crate::splat::checks::{camera, conforms, scene};
    use crate::splat::{CpuRasterizer, WeightCache, prepare, sh};

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
