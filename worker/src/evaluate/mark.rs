//! Makes one mark and measures it: the key, the marked file, how much it shows.
use std::path::{Path, PathBuf};

use guardsplat_evaluation::report::record::{Embedding, Mark};

use super::read::Views;
use crate::error::{Error, Result};
use crate::machine::Machine;
use guardsplat_engine::embed::{Progress, Settings, optimise};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Message;
use guardsplat_engine::quality::{Quality, contact_sheet, measure, write_picture};
use guardsplat_engine::scene::{Gaussians, Scene};

/// Held-out accuracy from which on a mark counts as made.
const MADE: f64 = 0.99;
/// Views in the picture of differences.
const SHOWN: usize = 3;

/// What a mark is made of.
pub(super) struct Marking<'a> {
    pub engine: &'a Engine,
    pub scene: &'a Scene,
    pub message: &'a Message,
    pub settings: &'a Settings,
    /// The store's folder.
    pub folder: &'a Path,
    pub machine: &'a Machine,
    /// Whether seconds are what is asked for.
    pub timed: bool,
}

/// Where the marked scene of an embedding lies, in the store's folder.
pub(super) fn path(folder: &Path, id: &str, scene: &Scene) -> PathBuf {
    folder
        .join("marks")
        .join(format!("{id}.{}", scene.format().extension()))
}

impl Marking<'_> {
    /// Embeds, writes the marked scene, reads it back, and compares. `key` is the time that making the key took and its
    /// accuracy on texts that it was not trained on.
    pub fn make(
        &self,
        embedding: Embedding,
        experiment: &str,
        key: (Option<f64>, Option<f64>),
        unmarked: &Views,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<(Mark, Gaussians)> {
        if self.timed {
            self.warm_up()?;
        }
        let stopwatch = self.machine.stopwatch();
        let mut made_after = None;
        let optimised = optimise(self.engine, self.scene, self.message, self.settings, &[], &mut |p| {
            if let Progress::Check(check) = p
                && check.bit_accuracy >= MADE
            {
                made_after.get_or_insert(check.step);
            }
            progress(p);
        })?;
        let (seconds, timing) = stopwatch.stop();
        let id = embedding.id().to_string();
        let path = path(self.folder, &id, self.scene);
        make_folder(&path)?;
        self.scene
            .write(&path, &optimised.learned.colours(&self.scene.gaussians.sh))?;
        let marked = Scene::read(&path)?.into_gaussians();

        let seen = Views::render(self.engine, &marked, &unmarked.cameras)?;
        let pairs: Vec<_> = unmarked.pictures()?.into_iter().zip(seen.pictures()?).collect();
        let compute = &self.engine.compute;
        let quality: Quality = measure(&pairs, self.engine.lpips()?, &compute.device, &self.engine.stop)?;
        let picture = PathBuf::from("pictures").join(format!("{id}.png"));
        make_folder(&self.folder.join(&picture))?;
        let shown = &pairs[..pairs.len().min(SHOWN)];
        write_picture(&self.folder.join(&picture), &contact_sheet(shown)?)?;
        let before = unmarked.read(self.engine, self.message)?.each()?.compare(
            &self.engine.message_code,
            self.message,
            &self.engine.acceptance_rule(1),
        )?;
        Ok((
            Mark {
                experiment: experiment.into(),
                gaussians: self.scene.gaussians.len() as u64,
                device: compute.name.clone(),
                psnr_db: quality.psnr.psnr_db,
                ssim: quality.ssim,
                lpips: quality.lpips,
                seconds,
                key_seconds: key.0,
                steps: optimised.steps as u64,
                view_steps: optimised.view_steps as u64,
                view_steps_to_99: made_after.map(|step| (step * self.settings.views_per_step) as u64),
                decoder_accuracy: key.1,
                peak_memory_bytes: guardsplat_engine::memory::peak(),
                unmarked_accuracy: Some(before.bit_accuracy),
                difference_picture: Some(picture),
                timing: Some(timing),
                embedding,
            },
            marked,
        ))
    }

    /// Has a graphics card's kernels compiled for pictures of this size, which only the first embedding would pay for.
    fn warm_up(&self) -> Result<()> {
        if self.engine.compute.name == "cpu" {
            return Ok(());
        }
        let settings = Settings {
            steps: 2,
            early_stop: None,
            ..*self.settings
        };
        optimise(self.engine, self.scene, self.message, &settings, &[], &mut |_| {})?;
        Ok(())
    }
}

fn make_folder(path: &Path) -> Result<()> {
    match path.parent() {
        Some(folder) => std::fs::create_dir_all(folder).map_err(Error::io(folder)),
        None => Ok(()),
    }
}
