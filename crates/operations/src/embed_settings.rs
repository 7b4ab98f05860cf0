//! The settings of an embedding from what users choose.
use guardsplat_distortion::RobustTo;
use guardsplat_engine::Result;
use guardsplat_engine::embed::{Preset, Ring, Settings, TrainableCoefficients};
use guardsplat_engine::view::SceneKind;

/// What users choose of an embedding; what they leave is as the preset has it.
#[derive(Clone, Debug, Default)]
pub struct Choices {
    /// Where all other settings come from.
    pub preset: Preset,
    /// Decides views, backgrounds and augmentation.
    pub seed: u64,
    /// Side of training views and of those of the verification, in pixels.
    pub size: Option<u32>,
    /// What the mark is trained to stand.
    pub robust_to: Option<RobustTo>,
    /// Which coefficients are learned.
    pub learn: TrainableCoefficients,
    /// Degrees above the horizon at which training views are, on a circle.
    pub ring: Option<f32>,
    /// The kind of scene, instead of the one that is found.
    pub kind: Option<SceneKind>,
    /// JSON with settings in place of the preset's.
    pub overrides: Option<String>,
}

impl Choices {
    /// The settings that are chosen.
    ///
    /// # Errors
    /// Those of [`Settings::overridden`] and [`Settings::check`].
    pub fn settings(&self) -> Result<Settings> {
        let mut settings = self.preset.settings();
        if let Some(json) = &self.overrides {
            settings = settings.overridden(json)?;
        }
        if let Some(robust_to) = self.robust_to {
            settings.robust_to = robust_to;
        }
        if let Some(elevation) = self.ring {
            settings.ring = Some(Ring { elevation });
        }
        if let Some(kind) = self.kind {
            settings.kind = Some(kind);
        }
        chosen(settings.learning(self.learn), self.seed, self.size)
    }
}

/// `base` with a seed, and a size of the training views that the verification's follow.
pub fn chosen(base: Settings, seed: u64, size: Option<u32>) -> Result<Settings> {
    let mut settings = Settings { seed, ..base };
    if let Some(size) = size {
        settings.size = size;
        settings.times_of_fine = 1;
        settings.verify.size = Some(size);
    }
    settings.check()?;
    Ok(settings)
}
