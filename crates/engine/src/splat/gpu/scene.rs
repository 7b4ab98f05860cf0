//! A scene's colours on a device, with what is learned of them: a step uploads no colours and reads no gradients.
use std::ops::Range;

use super::GpuRasterizer;
use super::batch::{Batch, Group};
use super::harmonics::{NO_SLOT, coefficient_gradients, colours_of_rows};
use crate::error::Result;
use crate::launch::{Buffer, grid};
use crate::scene::Gaussians;
use crate::splat::Learnable;

/// Coefficients of a scene and changes of some, in chunks whose buffers the device can bind.
pub(crate) struct SceneOnDevice {
    chunks: Vec<Chunk>,
    degree: usize,
    learned_degree: usize,
}

/// Some rows of a scene, and what is learned of them.
pub(crate) struct Chunk {
    first_row: u32,
    /// `[rows][3]`.
    positions: Buffer,
    /// `[rows][columns of the scene's degree]`.
    coefficients: Buffer,
    /// The chunk's slot of each row, or [`NO_SLOT`].
    slot_of_row: Buffer,
    /// Row of each slot.
    row_of_slot: Buffer,
    /// Which of all slots they are.
    pub slots: Range<usize>,
    /// What is added to coefficients, `[slots][columns]`.
    pub offsets: Buffer,
    /// The gradient to it.
    pub gradient: Buffer,
}

impl SceneOnDevice {
    /// Of a scene, of whose coefficients those that are `learnable` change; by 0 so far.
    pub fn new(rasterizer: &GpuRasterizer, gaussians: &Gaussians, learnable: &Learnable) -> Self {
        let sh = &gaussians.sh;
        let (client, stride, columns) = (rasterizer.client(), sh.per_gaussian(), learnable.columns());
        let rows_of_chunk = (rasterizer.limit() / (4 * stride.max(columns)) as u64).clamp(1, 1 << 30) as usize;
        let mut chunks = Vec::new();
        let mut first_slot = 0;
        for (index, coefficients) in sh.coefficients.chunks(rows_of_chunk * stride).enumerate() {
            let first_row = index * rows_of_chunk;
            let rows = first_row..first_row + coefficients.len() / stride;
            let slots_of_all = rows.clone().map(|row| learnable.slot(row as u32));
            let slot_of_row: Vec<u32> = slots_of_all
                .map(|slot| slot.map_or(NO_SLOT, |slot| (slot - first_slot) as u32))
                .collect();
            let count = slot_of_row.iter().filter(|slot| **slot != NO_SLOT).count();
            let slots = first_slot..first_slot + count;
            chunks.push(Chunk {
                first_row: first_row as u32,
                positions: Buffer::of(client, gaussians.positions[rows].as_flattened()),
                coefficients: Buffer::of(client, coefficients),
                slot_of_row: Buffer::of(client, &slot_of_row),
                row_of_slot: Buffer::of(client, &learnable.rows()[slots.clone()]),
                offsets: Buffer::zeros(client, count * columns),
                gradient: Buffer::zeros(client, count * columns),
                slots,
            });
            first_slot += count;
        }
        Self {
            chunks,
            degree: sh.degree,
            learned_degree: learnable.degree(),
        }
    }

    /// Where offsets and gradients are.
    pub fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Numbers of a slot.
    pub fn columns(&self) -> usize {
        3 * (self.learned_degree + 1) * (self.learned_degree + 1)
    }

    /// Colours of the visible Gaussians of each group, `[colours][3]`, with offsets and without. `noise` is added to those of
    /// each view of the batch that has any.
    pub fn colours(&self, rasterizer: &GpuRasterizer, batch: &Batch, noise: &[&[f32]]) -> [Vec<Buffer>; 2] {
        let of_group = |group: &Group| {
            let [out, originals] = [0; 2].map(|_| Buffer::empty(rasterizer.client(), 3 * group.colours()));
            let noise = noise_of(group, noise);
            let noisy = !noise.is_empty();
            // What is not there is not read.
            let noise = match noisy {
                true => Buffer::of(rasterizer.client(), &noise),
                false => group.table.clone(),
            };
            for chunk in &self.chunks {
                let (count, dim) = grid(group.most_visible(), group.views.len());
                colours_of_rows::launch(
                    rasterizer.client(),
                    count,
                    dim,
                    group.words.argument(),
                    group.table.argument(),
                    chunk.positions.argument(),
                    chunk.coefficients.argument(),
                    chunk.slot_of_row.argument(),
                    chunk.offsets.argument(),
                    noise.argument(),
                    out.argument(),
                    originals.argument(),
                    chunk.first_row,
                    self.degree,
                    self.columns(),
                    noisy,
                );
            }
            (out, originals)
        };
        let (colours, originals) = batch.groups.iter().map(of_group).unzip();
        [colours, originals]
    }

    /// What gradients to the slots of views ([`GpuRasterizer::slot_gradients`]) mean for what is learned: to the chunks'
    /// gradients. `colours` are those that the views were drawn with.
    pub fn differentiate(&self, rasterizer: &GpuRasterizer, batch: &Batch, colours: &[Buffer], slots: &[Buffer]) {
        for chunk in self.chunks.iter().filter(|chunk| !chunk.slots.is_empty()) {
            for (index, group) in batch.groups.iter().enumerate() {
                let (count, dim) = grid(chunk.slots.len(), 1);
                coefficient_gradients::launch(
                    rasterizer.client(),
                    count,
                    dim,
                    group.words.argument(),
                    group.table.argument(),
                    slots[index].argument(),
                    colours[index].argument(),
                    chunk.positions.argument(),
                    chunk.row_of_slot.argument(),
                    chunk.gradient.argument(),
                    chunk.first_row,
                    group.views.len() as u32,
                    self.learned_degree,
                    index > 0,
                );
            }
        }
    }

    /// Takes `offsets` (`[slots][columns]`) for all chunks.
    pub fn set_offsets(&mut self, rasterizer: &GpuRasterizer, offsets: &[f32]) {
        let columns = self.columns();
        for chunk in &mut self.chunks {
            let own = &offsets[chunk.slots.start * columns..chunk.slots.end * columns];
            chunk.offsets = Buffer::of(rasterizer.client(), own);
        }
    }

    /// Takes a gradient (`[slots][columns]`) for all chunks.
    #[cfg(test)]
    pub fn set_gradient(&mut self, rasterizer: &GpuRasterizer, gradient: &[f32]) {
        let columns = self.columns();
        for chunk in &mut self.chunks {
            let own = &gradient[chunk.slots.start * columns..chunk.slots.end * columns];
            chunk.gradient = Buffer::of(rasterizer.client(), own);
        }
    }

    /// Numbers of all chunks, `[slots][columns]`: their offsets or their gradients. Waits for them.
    ///
    /// # Errors
    /// A failing device.
    pub fn read(&self, rasterizer: &GpuRasterizer, of: fn(&Chunk) -> &Buffer, out: &mut Vec<f32>) -> Result<()> {
        let buffers: Vec<Buffer> = self.chunks.iter().map(|chunk| of(chunk).clone()).collect();
        out.clear();
        for numbers in rasterizer.read(&buffers)? {
            out.extend(numbers);
        }
        Ok(())
    }
}

/// The noise of a group's views, `[colours][3]`; nothing where none has any.
fn noise_of(group: &Group, noise: &[&[f32]]) -> Vec<f32> {
    let of_views = noise.get(group.views.clone()).unwrap_or_default();
    if of_views.iter().all(|noise| noise.is_empty()) {
        return Vec::new();
    }
    let mut all = Vec::with_capacity(3 * group.colours());
    for (noise, visible) in of_views.iter().zip(&group.visible) {
        match noise.is_empty() {
            true => all.resize(all.len() + 3 * visible, 0.0),
            false => all.extend_from_slice(noise),
        }
    }
    all
}

#[cfg(test)]
mod tests;
