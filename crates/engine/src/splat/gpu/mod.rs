//! Rasteriser for GPUs: CubeCL kernels on the wgpu device that burn uses.
mod batch;
mod compositing;
mod drawing;
mod gradients;
mod harmonics;
mod host_colours;
mod kernels;
mod scene;
mod uploads;

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use burn::backend::Cube;
use burn::tensor::{Bytes, Device, Tensor};
use burn_cubecl::CubeDevice;
use burn_cubecl::kernel::into_contiguous;
use cubecl::prelude::*;

use self::uploads::Uploads;
use super::PreparedView;
use crate::error::{Error, Result};
use crate::launch::Buffer;

pub(crate) use self::batch::{Batch, PackedView, Shown};
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
