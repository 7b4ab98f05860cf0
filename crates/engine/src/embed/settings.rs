//! Every number of an embedding.
use guardsplat_distortion::{Layer, Ranges, RobustTo};
use serde::{Deserialize, Serialize};

use super::augment::Augmentation;
use super::loss_weight_controller::LossWeightControl;
use super::optimizer::{Optimizer, accept_names};
use super::preconditioned_sgd::PreconditionedSgdOptions;
use super::target::Target;
use crate::error::{Error, Result};
use crate::view::{Camera, SceneKind, Viewpoints};

/// Weights of the terms of the loss.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossWeights {
    /// Of all terms that compare pictures.
    pub reconstruction: f32,
    /// Of the mean absolute difference, within reconstruction.
    pub l1: f32,
    /// Of the mean squared difference, within reconstruction. A difference of 0.015 weighs as much in 33 of these as in 1
    /// of the absolute ones.
    pub l2: f32,
    /// Of 1 - SSIM, within reconstruction.
    pub ssim: f32,
    /// Of LPIPS, within reconstruction; without its weights, or at 0, it is left out.
    pub lpips: f32,
    /// Of the binary cross entropy of the message.
    pub message: f32,
    /// Logits are divided by this before the cross entropy, whose gradient is kept by multiplying it: how far beyond
    /// zero a logit is still pushed. Logits vary by about ten from view to view; at 1, bits that are right in the mean
    /// are left to be wrong in many views.
    pub temperature: f32,
    /// Of the mean squared offset of constant (DC) coefficients.
    pub offset_dc: f32,
    /// Of the mean squared offset of all other coefficients.
    pub offset_rest: f32,
}

/// When to stop before the last step: held-out views, other ones than those of the verification, are read every so
/// often, and all of this must hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EarlyStop {
    /// Steps between checks.
    pub every: usize,
    /// Views a check.
    pub views: usize,
    /// First step that may be the last.
    pub min_steps: usize,
    /// Mean bit accuracy needed.
    pub bit_accuracy: f64,
    /// Mean logit needed of the weakest bit, in the right direction.
    pub margin: f64,
    /// Mean PSNR needed, dB.
    pub psnr_db: f64,
    /// Checks in a row that must hold.
    pub patience: usize,
}

/// What is done where bits stay wrong in the views of the early stop: more steps, in which weak bits weigh more.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extension {
    /// The first look after so many steps decides.
    pub after: usize,
    /// Mean bit accuracy below which they do.
    pub below: f64,
    /// What the number of steps is multiplied by.
    pub times: u32,
    /// How often at most. The next time it is decided after `times` as many steps, for `times` as many wrong bits.
    pub most: u32,
    /// [`LossWeights::temperature`] from then on.
    pub temperature: f32,
}

impl Extension {
    /// What decides the next time, if there is one.
    pub(super) fn next(self) -> Option<Self> {
        let left = self.most.saturating_sub(1);
        (left > 0).then(|| Self {
            after: self.after.saturating_mul(self.times as usize),
            below: 1.0 - (1.0 - self.below) * f64::from(self.times),
            most: left,
            ..self
        })
    }
}

/// How the marked file is verified.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Verify {
    /// Held-out views.
    pub views: usize,
    /// Their side in pixels; `None` takes CLIP's input.
    pub size: Option<u32>,
    /// The message must be right from so many of them.
    pub message_views: usize,
}

/// Training views on a circle around the scene, all at one height and one distance, as in the paper's public code, instead
/// of over the sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// Degrees above the scene's horizon, -80 to 80.
    pub elevation: f32,
}

/// The numbers of an embedding.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Decides views, backgrounds and augmentation.
    pub seed: u64,
    /// Most optimiser steps.
    pub steps: usize,
    /// What steps are multiplied by where every view shows another part of the scene, as inside a room: a Gaussian is in
    /// fewer views then, and each of them has its own colours to bring to the message. So is their length where views are
    /// found, and not where cameras were given: what few of these show would be changed too much.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub times_of_parts: u32,
    /// What the sides of views may be multiplied by, 1 or 2: more where the scene has splats so fine that views show other
    /// colours than pictures do. They stand for the same pictures then.
    #[serde(default = "once", skip_serializing_if = "is_once")]
    pub times_of_fine: u32,
    /// What is done where bits stay wrong; `None` for nothing. It needs an early stop, which looks at held-out views.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extension: Option<Extension>,
    /// Views a step.
    pub views_per_step: usize,
    /// How many of them were never used before; the others are drawn from the pool. With 0 the first step's views are
    /// all there ever are.
    pub fresh_per_step: usize,
    /// Most different training views; `None` has fresh ones at every step. Never fewer than it takes to show every
    /// Gaussian that can be seen.
    pub views: Option<usize>,
    /// Where training views are taken from; `None` has them over the sphere. Held-out views are over the sphere in any case.
    // Left out of JSON where there is none, so that settings from before it was there have the hash that they had.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ring: Option<Ring>,
    /// The kind of the scene, which says where its views are; `None` finds it from the scene. Without a meaning where cameras
    /// are given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<SceneKind>,
    /// Views that are kept for later steps; fresh ones replace the oldest.
    pub pool_views: usize,
    /// Memory for kept views, in MiB; the oldest go first.
    pub pool_mebibytes: usize,
    /// Keeps what views are drawn with in half precision: three bytes a weight instead of five.
    pub half_weights: bool,
    /// Side of training views in pixels.
    pub size: u32,
    /// Training views stand for pictures of 1 to so many times their side, averaged down: a scene looks a little different
    /// when it is drawn larger, and pictures of any size must be read.
    pub enlarged: f32,
    /// Share of training views over black instead of white.
    pub black_backgrounds: f32,
    /// Share of training views of a forward-facing capture of which a part is shown, 0.35 to 0.9 of each side: what is left of
    /// a cropped picture is another part of such a scene each time, and views of the whole teach no mark to be read there.
    pub windows: f32,
    /// Share of training views of an unbounded scene that show what it was captured for alone: people cut that out, and its
    /// surroundings carry a good part of the mark.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub cut_out: f32,
    /// Weights of the loss.
    pub lambda: LossWeights,
    /// Views of a step that LPIPS looks at, the next ones at every step; its time is nearly all of a step's. `None` for all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lpips_views: Option<usize>,
    /// Views of a step that the distortions of pictures may be done to, others each step: they take most of its time.
    /// `None` for all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distorted_views: Option<usize>,
    /// The optimiser. In JSON `{"optimizer": {"adam": {..}}}` or `{"optimizer": {"preconditioned_sgd": {..}}}`; it is
    /// written as the fields `adam` and `descent`, its old names.
    #[serde(flatten)]
    pub optimizer: Optimizer,
    /// Holds a PSNR by changing the weight of reconstruction; `None` leaves it.
    pub balance: Option<LossWeightControl>,
    /// What CLIP sees of a training view besides the view itself.
    pub augmentation: Augmentation,
    /// What is done to training views, and to the scene that they show, so that the mark stands it: each view gets one
    /// of these or nothing, all equally likely.
    pub robust_to: RobustTo,
    /// How strong the distortions of pictures are.
    pub distortions: Ranges,
    /// Side in pixels to which a training view is enlarged before its picture is distorted, where that is more than its
    /// own: squares of JPEG and grains of noise are as large, against the scene, as in pictures of that side.
    pub distorted_size: u32,
    /// When to stop before the last step.
    pub early_stop: Option<EarlyStop>,
    /// How the result is verified.
    pub verify: Verify,
    /// What it must reach.
    pub target: Target,
}

impl Settings {
    /// These settings with the fields of a JSON object in place of their own; for experiments.
    ///
    /// # Errors
    /// Text that is not a JSON object, unknown fields, values of another kind, or what [`Settings::check`] refuses.
    pub fn overridden(&self, json: &str) -> Result<Self> {
        let bad = |e: serde_json::Error| Error::BadOption {
            field: "settings",
            reason: e.to_string(),
        };
        let mut changes: serde_json::Map<String, serde_json::Value> = serde_json::from_str(json).map_err(bad)?;
        accept_names(&mut changes).map_err(|reason| Error::BadOption {
            field: "settings",
            reason,
        })?;
        // Options of an optimiser that was not chosen before begin as they are by default.
        if let Some(options @ serde_json::Value::Object(_)) = changes.get_mut("descent")
            && !matches!(self.optimizer, Optimizer::PreconditionedSgd(_))
        {
            let mut sgd = serde_json::to_value(PreconditionedSgdOptions::default()).map_err(bad)?;
            merge(&mut sgd, options.take());
            *options = sgd;
        }
        let mut all = serde_json::to_value(self).map_err(bad)?;
        merge(&mut all, serde_json::Value::Object(changes));
        let settings: Settings = serde_json::from_value(all).map_err(bad)?;
        settings.check()?;
        Ok(settings)
    }

    /// Where views are taken from, with these cameras, if there are any.
    pub fn viewpoints<'a>(&self, cameras: &'a [Camera]) -> Viewpoints<'a> {
        Viewpoints {
            kind: self.kind,
            cameras,
        }
    }

    /// What training views go through.
    pub(super) fn layer(&self) -> Layer {
        Layer {
            robust_to: self.robust_to,
            ranges: self.distortions,
        }
    }

    /// Checks every number that could make a run fail, hang or lose its meaning.
    ///
    /// # Errors
    /// [`Error::BadOption`] naming the setting and its limits.
    pub fn check(&self) -> Result<()> {
        let count = |field, value: usize, most: usize| within(field, value as f64, 1.0, most as f64);
        count("steps", self.steps, 10_000_000)?;
        within("times_of_parts", f64::from(self.times_of_parts), 1.0, 100.0)?;
        within("times_of_fine", f64::from(self.times_of_fine), 1.0, 2.0)?;
        if let Some(extension) = &self.extension {
            count("extension.after", extension.after, 10_000_000)?;
            within("extension.below", extension.below, 0.0, 1.0)?;
            count("extension.times", extension.times as usize, 100)?;
            count("extension.most", extension.most as usize, 10)?;
            within("extension.temperature", f64::from(extension.temperature), 1e-3, 1e6)?;
        }
        count("views_per_step", self.views_per_step, 1024)?;
        within(
            "fresh_per_step",
            self.fresh_per_step as f64,
            0.0,
            self.views_per_step as f64,
        )?;
        if let Some(views) = self.lpips_views {
            within("lpips_views", views as f64, 1.0, self.views_per_step as f64)?;
        }
        if let Some(views) = self.distorted_views {
            within("distorted_views", views as f64, 1.0, 1e6)?;
        }
        if let Some(views) = self.views {
            within("views", views as f64, self.views_per_step as f64, 1e6)?;
        }
        count("pool_views", self.pool_views, 1_000_000)?;
        within("size", f64::from(self.size), 16.0, 4096.0)?;
        within("distorted_size", f64::from(self.distorted_size), 16.0, 4096.0)?;
        if let Some(ring) = &self.ring {
            within("ring.elevation", f64::from(ring.elevation), -80.0, 80.0)?;
        }
        within("enlarged", f64::from(self.enlarged), 1.0, 16.0)?;
        within("black_backgrounds", f64::from(self.black_backgrounds), 0.0, 1.0)?;
        within("windows", f64::from(self.windows), 0.0, 1.0)?;
        within("cut_out", f64::from(self.cut_out), 0.0, 1.0)?;
        let l = &self.lambda;
        for (field, value) in [
            ("lambda.reconstruction", l.reconstruction),
            ("lambda.l1", l.l1),
            ("lambda.l2", l.l2),
            ("lambda.ssim", l.ssim),
            ("lambda.lpips", l.lpips),
            ("lambda.message", l.message),
            ("lambda.offset_dc", l.offset_dc),
            ("lambda.offset_rest", l.offset_rest),
        ] {
            within(field, f64::from(value), 0.0, 1e9)?;
        }
        within("lambda.temperature", f64::from(l.temperature), 1e-3, 1e6)?;
        self.optimizer.check()?;
        self.augmentation.check()?;
        self.layer().check().map_err(|e| Error::BadOption {
            field: "distortions",
            reason: e.to_string(),
        })?;
        if let Some(balance) = &self.balance {
            balance.check()?;
        }
        if let Some(stop) = &self.early_stop {
            count("early_stop.every", stop.every, usize::MAX)?;
            count("early_stop.views", stop.views, 1000)?;
            count("early_stop.patience", stop.patience, usize::MAX)?;
        }
        count("verify.views", self.verify.views, 1000)?;
        count("verify.message_views", self.verify.message_views, self.verify.views)?;
        if let Some(size) = self.verify.size {
            within("size", f64::from(size), 16.0, 4096.0)?;
        }
        Ok(())
    }
}

/// Settings from before this one was there have the hash that they had.
fn once() -> u32 {
    1
}

fn is_zero(share: &f32) -> bool {
    *share == 0.0
}

fn is_once(times: &u32) -> bool {
    *times == 1
}

/// Fails unless `low <= value <= high`.
pub(super) fn within(field: &'static str, value: f64, low: f64, high: f64) -> Result<()> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(Error::BadOption {
        field,
        reason: format!("{value} is outside {low} to {high}"),
    })
}

/// Puts `changes` over `base`, object by object.
fn merge(base: &mut serde_json::Value, changes: serde_json::Value) {
    match (base, changes) {
        (serde_json::Value::Object(base), serde_json::Value::Object(changes)) => {
            for (field, value) in changes {
                merge(base.entry(field).or_insert(serde_json::Value::Null), value);
            }
        }
        (base, changes) => *base = changes,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::Preset;

    #[test]
    fn presets_are_valid_and_grow() {
        let view_steps = Preset::ALL.map(Preset::settings).map(|s| s.steps * s.views_per_step);
        assert!(view_steps.is_sorted(), "{view_steps:?}");
        assert_eq!(view_steps.last(), Some(&20_800));
        for preset in Preset::ALL {
            preset.settings().check().unwrap();
            assert_eq!(preset.name().parse::<Preset>().unwrap(), preset);
        }
        assert!("fast".parse::<Preset>().is_err());
    }

    #[test]
    fn overrides_reach_inner_fields_and_leave_the_rest() {
        let standard = Preset::Standard.settings();
        let changed = standard
            .overridden(r#"{"steps": 7, "lambda": {"message": 0.5}, "early_stop": null}"#)
            .unwrap();
        assert_eq!((changed.steps, changed.lambda.message), (7, 0.5));
        assert_eq!(changed.early_stop, None);
        assert_eq!(changed.lambda.l1, standard.lambda.l1);
        assert_eq!(changed.target, standard.target);
        let ring = standard.overridden(r#"{"ring": {"elevation": -12}}"#).unwrap().ring;
        assert_eq!(ring, Some(Ring { elevation: -12.0 }));
        let reason = |json| standard.overridden(json).unwrap_err().to_string();
        assert!(reason(r#"{"stepz": 7}"#).contains("stepz"));
        assert!(reason("[]").contains("settings"));
        assert!(reason(r#"{"fresh_per_step": 99}"#).contains("99 is outside 0 to 8"));
        assert!(reason(r#"{"size": 4}"#).contains("outside 16"));
        assert!(reason(r#"{"ring": {"elevation": 90}}"#).contains("90 is outside -80 to 80"));
        assert!(!serde_json::to_string(&standard).unwrap().contains("ring"));
    }
}
