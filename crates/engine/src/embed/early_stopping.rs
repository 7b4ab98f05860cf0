//! Looks at held-out views during an embedding, and decides when the margin is enough.
use std::sync::Arc;

use super::pooled_view::PooledView;
use super::progress::Check;
use super::settings::{EarlyStop, Settings};
use crate::error::Result;
use crate::extract::{Engine, PooledLogits, default_size, read_rendered, stands_for};
use crate::message::Message;
use crate::picture::Picture;
use crate::quality::{Psnr, mean_psnr, psnr};
use crate::splat::Geometry;
use crate::view::{Camera, Split, ViewSampler};

/// Held-out views, prepared once, and how many checks in a row were passed. A clone has the same views.
#[derive(Clone)]
pub(super) struct EarlyStopping {
    stop: EarlyStop,
    views: Arc<Vec<PooledView>>,
    passed: usize,
}

impl EarlyStopping {
    /// Prepares the views that follow those of the verification, so that no report is made on views that a decision
    /// was taken on.
    pub fn new(
        engine: &Engine,
        geometry: &Geometry<'_>,
        sampler: &ViewSampler,
        settings: &Settings,
        stop: EarlyStop,
    ) -> Result<Self> {
        let first = settings.verify.views as u64;
        let size = settings.verify.size.unwrap_or_else(|| default_size(engine));
        let indices = first..first + stop.views as u64;
        let cameras: Vec<Camera> = indices
            .map(|index| sampler.camera(Split::HeldOut, index, size))
            .collect();
        let (times, half) = (stands_for(size), settings.half_weights);
        let mut views = PooledView::of_cameras(engine, geometry, &cameras, times, half, [1.0; 3])?;
        for view in &mut views {
            view.reference = view.reference.to_8_bit();
        }
        let views = Arc::new(views);
        Ok(Self { stop, views, passed: 0 })
    }

    /// Whether this step is one to look after.
    pub fn due(&self, step: usize) -> bool {
        step.is_multiple_of(self.stop.every)
    }

    /// The views that are looked at.
    pub fn views(&self) -> Arc<Vec<PooledView>> {
        self.views.clone()
    }

    /// Reads pictures of the views as they are now; the second value says whether to stop.
    pub fn check(
        &mut self,
        engine: &Engine,
        pictures: &[Picture],
        message: &Message,
        step: usize,
    ) -> Result<(Check, bool)> {
        let pictures: Vec<Picture> = pictures.iter().map(Picture::to_8_bit).collect();
        let psnrs = self
            .views
            .iter()
            .zip(&pictures)
            .map(|(view, picture)| psnr(&view.reference, picture))
            .collect::<Result<Vec<Psnr>>>()?;
        let reading = PooledLogits::new(read_rendered(engine, &pictures)?)?;
        let code = &engine.message_code;
        let check = Check {
            step,
            bit_accuracy: reading.compare(code, message, &engine.acceptance_rule(1))?.bit_accuracy,
            psnr_db: mean_psnr(&psnrs)?.psnr_db.unwrap_or(f64::INFINITY),
            margin: code.margin(&reading.summed, message)? / reading.views.len() as f64,
        };
        let stop = &self.stop;
        let holds =
            check.bit_accuracy >= stop.bit_accuracy && check.margin >= stop.margin && check.psnr_db >= stop.psnr_db;
        self.passed = if holds { self.passed + 1 } else { 0 };
        let enough = self.passed >= stop.patience && step >= stop.min_steps;
        Ok((check, enough))
    }
}
