//! The GPU rasteriser with colours and gradients of the host, as every rasteriser has it.
use burn::tensor::{Device, Tensor};

use super::batch::{Group, Shown};
use super::kernels::sum_slots;
use super::{GpuRasterizer, PreparedView};
use crate::error::Result;
use crate::launch::{Buffer, grid};
use crate::picture::Picture;
use crate::quality::{batch, unbatch};
use crate::splat::{Drawing, Rasterizer};

impl GpuRasterizer {
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
        let lights = self.lights(&batch)?;
        let slots = self.slot_gradients(&batch, &lights, gradient)?;
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
        self.draw_backward(views, batch(&pictures, &device)?)
    }
}
