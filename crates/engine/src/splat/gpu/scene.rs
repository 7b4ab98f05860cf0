//! A scene's colours on a device, with what is learned of them: a step uploads no colours and reads no gradients.
use std::ops::Range;

use super::GpuRasterizer;
use super::batch::{Batch, Group};
use super::buffer::{Buffer, grid};
use super::harmonics::{NO_SLOT, coefficient_gradients, colours_of_rows};
use crate::error::Result;
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

    /// Colours of the visible Gaussians of each group, `[colours][3]`, with offsets if `changed`. `noise` is added to those of
    /// each view of the batch that has any.
    pub fn colours(&self, rasterizer: &GpuRasterizer, batch: &Batch, noise: &[&[f32]], changed: bool) -> Vec<Buffer> {
        let of_group = |group: &Group| {
            let out = Buffer::empty(rasterizer.client(), 3 * group.colours());
            let noise = noise_of(group, noise);
            let (noisy, noise) = (!noise.is_empty(), Buffer::of(rasterizer.client(), &noise));
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
                    chunk.first_row,
                    self.degree,
                    if changed { self.columns() } else { 0 },
                    noisy,
                );
            }
            out
        };
        batch.groups.iter().map(of_group).collect()
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
mod tests {
    use super::*;
    use crate::device::{DeviceChoice, open};
    use crate::picture::Picture;
    use crate::quality::{batch, unbatch};
    use crate::splat::checks::{camera, scene};
    use crate::splat::{Changes, CpuRasterizer, Drawing, PreparedView, Rasterizer, Shown, WeightCache, prepare, sh};

    const BACKGROUNDS: [[f32; 3]; 3] = [[1.0; 3], [0.0; 3], [0.2, 0.6, 1.0]];

    /// Three views of `g`, one of which shows fewer bands, and the changes of two of three Gaussians up to degree 1.
    struct Case {
        g: Gaussians,
        views: Vec<PreparedView>,
        noise: Vec<f32>,
        learnable: Learnable,
        offsets: Vec<f32>,
    }

    fn case() -> Case {
        let g = scene(600, 3);
        let mut views: Vec<PreparedView> = [0.0, 0.3, -0.4]
            .map(|x| {
                let mut camera = camera(32);
                camera.translation[0] += x;
                prepare(&g, &camera, WeightCache::None).unwrap()
            })
            .into();
        views[1].degree = 1;
        let noise = (0..3 * views[2].visible.len()).map(|i| ((i % 13) as f32 - 6.0) * 0.01);
        let seen: Vec<bool> = (0..g.len()).map(|row| row % 3 != 1).collect();
        let learnable = Learnable::new(&seen, 1);
        Case {
            offsets: (0..learnable.len())
                .map(|i| ((i * 31 % 17) as f32 - 8.0) * 0.03)
                .collect(),
            noise: noise.collect(),
            views,
            learnable,
            g,
        }
    }

    fn close(found: &[f32], want: &[f32], what: &str) {
        assert_eq!(found.len(), want.len(), "{what}");
        let largest = want.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        let off = found.iter().zip(want).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(
            largest > 0.0 && off < 1e-4 * largest.max(1.0),
            "{what}: {off} of {largest}"
        );
    }

    /// Also where buffers hold but one view, and a few rows of the scene.
    #[test]
    fn a_scene_on_a_card_is_drawn_and_differentiated_as_on_the_cpu() {
        let device = match open(DeviceChoice::Wgpu) {
            Ok(compute) => compute.device,
            Err(error) => {
                assert!(std::env::var_os("CI").is_none(), "{error}");
                eprintln!("skipped: {error}");
                return;
            }
        };
        let Case {
            g,
            views,
            noise,
            learnable,
            offsets,
        } = case();
        let prepared: Vec<&PreparedView> = views.iter().collect();
        let changes = Changes {
            learnable: &learnable,
            values: &offsets,
        };
        let mut colours = sh::colours_of_views(&g.sh, Some(changes), &prepared);
        for (colour, noise) in colours[2].iter_mut().zip(&noise) {
            *colour = (*colour + noise).max(0.0);
        }
        let drawings: Vec<Drawing<'_>> = (0..3)
            .map(|i| Drawing {
                view: &views[i],
                colours: &colours[i],
                background: BACKGROUNDS[i],
            })
            .collect();
        let pictures = CpuRasterizer.render_all(&drawings).unwrap();
        // Some gradient: the pictures themselves.
        let gradients = CpuRasterizer.backward_all(&prepared, &pictures).unwrap();
        let of_views: Vec<sh::ColourGradient<'_>> = (0..3)
            .map(|i| sh::ColourGradient {
                view: &views[i],
                colours: &colours[i],
                gradient: &gradients[i],
            })
            .collect();
        let mut gradient = vec![0.0; learnable.len()];
        sh::backward_of_views(&learnable, &of_views, &mut gradient);

        for limit in [u64::MAX, 60_000] {
            let mut rasterizer = GpuRasterizer::new(&device).unwrap();
            rasterizer.limit = rasterizer.limit.min(limit);
            let mut on_device = SceneOnDevice::new(&rasterizer, &g, &learnable);
            on_device.set_offsets(&rasterizer, &offsets);
            let shown: Vec<Shown<'_>> = drawings.iter().map(Shown::from).collect();
            let all = rasterizer.batch(&shown).unwrap();
            let split = limit < u64::MAX;
            assert_eq!(
                (all.groups.len(), on_device.chunks.len() > 1),
                (if split { 3 } else { 1 }, split)
            );
            let of_noise: [&[f32]; 3] = [&[], &[], &noise];
            let colours = on_device.colours(&rasterizer, &all, &of_noise, true);
            let drawn = unbatch(rasterizer.composite(&all, &colours).unwrap()).unwrap();
            for (found, want) in drawn.iter().zip(&pictures) {
                close(&found.pixels, &want.pixels, "pictures");
            }
            let of_pictures = batch(&pictures.iter().collect::<Vec<&Picture>>(), &device).unwrap();
            let slots = rasterizer.slot_gradients(&all, of_pictures).unwrap();
            on_device.differentiate(&rasterizer, &all, &colours, &slots);
            let mut found = Vec::new();
            on_device
                .read(&rasterizer, |chunk| &chunk.gradient, &mut found)
                .unwrap();
            close(&found, &gradient, "gradient");
            // Without the changes.
            let plain = on_device.colours(&rasterizer, &all, &[], false);
            let plain: Vec<f32> = rasterizer.read(&plain).unwrap().concat();
            close(
                &plain,
                &sh::colours_of_views(&g.sh, None, &prepared).concat(),
                "colours",
            );
        }
    }
}
