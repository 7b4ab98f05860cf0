//! Rasteriser for GPUs: CubeCL kernels on the wgpu device that burn uses.
mod batch;
mod compositing;
mod gradients;
mod harmonics;
mod host_colours;
mod kernels;
mod scene;
mod uploads;

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use burn::backend::Cube;
use burn::tensor::{Bytes, DType, Device, Shape, Tensor};
use burn_cubecl::CubeDevice;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use self::compositing::composite;
use self::gradients::splat_gradients;
use self::kernels::PIXELS;
use self::uploads::Uploads;
use super::PreparedView;
use super::tiles::TILE;
use crate::error::{Error, Result};
use crate::launch::{Buffer, columns_and_rows};
use crate::memory::Limits;

pub(crate) use self::batch::{Batch, Group, PackedView, Shown};
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
        let group = |range: Range<usize>| batch::group(&self.client, range.clone(), views, &uploaded[range]);
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
        let pictures = self.room_for_pictures(batch)?;
        let unused = Buffer::empty(&self.client, 1);
        for (group, colours) in batch.groups.iter().zip(colours) {
            self.draw_group(batch, group, [colours; 2], [&pictures; 2], &unused, [false; 2]);
        }
        Ok(self.pictures(batch, pictures))
    }

    /// [`GpuRasterizer::composite`] with colours and with those of the unmarked scene at once, which costs little more than
    /// one of both; and what gradients of these views begin with.
    ///
    /// # Errors
    /// As [`GpuRasterizer::composite`].
    pub(crate) fn composite_both(&self, batch: &Batch, colours: &[Buffer], originals: &[Buffer]) -> Result<Drawn> {
        let [pictures, others] = [self.room_for_pictures(batch)?, self.room_for_pictures(batch)?];
        let of_group = |(index, group): (usize, &Group)| {
            let lights = self.room_for_lights(group);
            let both = [&colours[index], &originals[index]];
            self.draw_group(batch, group, both, [&pictures, &others], &lights, [true; 2]);
            lights
        };
        let lights = batch.groups.iter().enumerate().map(of_group).collect();
        Ok(Drawn {
            pictures: self.pictures(batch, pictures),
            originals: self.pictures(batch, others),
            lights: Lights(lights),
        })
    }

    /// What gradients of views begin with that were not drawn.
    ///
    /// # Errors
    /// As [`GpuRasterizer::composite`].
    pub(crate) fn lights(&self, batch: &Batch) -> Result<Lights> {
        let pictures = self.room_for_pictures(batch)?;
        let of_group = |group: &Group| {
            let (lights, colours) = (
                self.room_for_lights(group),
                Buffer::empty(&self.client, 3 * group.colours()),
            );
            self.draw_group(batch, group, [&colours; 2], [&pictures; 2], &lights, [false, true]);
            lights
        };
        Ok(Lights(batch.groups.iter().map(of_group).collect()))
    }

    fn room_for_pictures(&self, batch: &Batch) -> Result<Buffer> {
        let len = batch.views * 3 * batch.height as usize * batch.width as usize;
        let limits = Limits::of_buffers(self.limit);
        limits.admit_buffer("the buffer of a batch's pictures", 4 * len as u64)?;
        Ok(Buffer::empty(&self.client, len))
    }

    fn room_for_lights(&self, group: &Group) -> Buffer {
        Buffer::empty(&self.client, group.chunks * PIXELS)
    }

    fn pictures(&self, batch: &Batch, pictures: Buffer) -> Tensor<4> {
        let shape = Shape::from(vec![batch.views, 3, batch.height as usize, batch.width as usize]);
        let (client, device) = (self.client.clone(), self.device.clone());
        Tensor::from_primitive::<Cube>(CubeTensor::new_contiguous(
            client,
            device,
            shape,
            pictures.handle,
            DType::F32,
        ))
    }

    /// Launches the drawing of a group; see [`composite`].
    fn draw_group(
        &self,
        batch: &Batch,
        group: &Group,
        colours: [&Buffer; 2],
        pictures: [&Buffer; 2],
        lights: &Buffer,
        [twice, keep]: [bool; 2],
    ) {
        composite::launch(
            &self.client,
            CubeCount::Static(group.tile_columns, group.tile_rows, group.views.len() as u32),
            CubeDim::new_2d(TILE, TILE),
            group.words.argument(),
            group.table.argument(),
            colours[0].argument(),
            colours[1].argument(),
            pictures[0].argument(),
            pictures[1].argument(),
            lights.argument(),
            batch.width,
            batch.height,
            twice,
            keep,
        );
    }

    /// What a gradient to pictures (`[views, 3, height, width]`) means for each slot of each group, `[pairs][3]`. Nothing is
    /// waited for.
    ///
    /// # Errors
    /// A gradient of another size, or that is not on the device.
    pub(crate) fn slot_gradients(
        &self,
        batch: &Batch,
        Lights(lights): &Lights,
        gradient: Tensor<4>,
    ) -> Result<Vec<Buffer>> {
        let gradient = self.buffer_of(gradient)?;
        if gradient.len != 3 * batch.views * batch.width as usize * batch.height as usize {
            return Err(self.failed("the gradient is not of these views"));
        }
        let of_group = |(group, lights): (&Group, &Buffer)| {
            let slots = Buffer::empty(&self.client, 3 * group.pairs);
            let (columns, rows) = columns_and_rows(group.most_chunks as u32);
            splat_gradients::launch(
                &self.client,
                CubeCount::Static(columns, rows, group.views.len() as u32),
                CubeDim::new_2d(TILE, TILE),
                group.words.argument(),
                group.table.argument(),
                gradient.argument(),
                lights.argument(),
                slots.argument(),
                batch.width,
                batch.height,
                group.tile_columns,
                group.tile_columns * group.tile_rows,
            );
            slots
        };
        Ok(batch.groups.iter().zip(lights).map(of_group).collect())
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

/// Views as they were drawn, with what gradients to their splats begin with.
pub(crate) struct Drawn {
    /// `[views, 3, height, width]`.
    pub pictures: Tensor<4>,
    /// With the colours of the unmarked scene.
    pub originals: Tensor<4>,
    pub lights: Lights,
}

/// The light that pixels have left before each chunk of their tile's list, `[chunks][256]` of each group.
pub(crate) struct Lights(Vec<Buffer>);

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

#[cfg(test)]
mod tests;
