//! Draws views on a card, and takes gradients to their pictures back to splats. Nothing is waited for.
use burn::backend::Cube;
use burn::tensor::{DType, Shape, Tensor};
use burn_cubecl::tensor::CubeTensor;
use cubecl::prelude::*;

use super::GpuRasterizer;
use super::batch::{Batch, Group};
use super::compositing::composite;
use super::gradients::splat_gradients;
use super::kernels::PIXELS;
use crate::error::Result;
use crate::launch::{Buffer, columns_and_rows};
use crate::memory::Limits;
use crate::splat::tiles::TILE;

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

impl GpuRasterizer {
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
}
