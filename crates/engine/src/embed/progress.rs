//! What an embedding tells whoever watches it.
use serde::Serialize;

use crate::memory::MemoryRequirements;

/// Unweighted terms of the loss, means over the views of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LossTerms {
    /// Mean absolute difference.
    pub l1: f32,
    /// 1 - SSIM.
    pub ssim: f32,
    /// LPIPS, when it takes part.
    pub lpips: Option<f32>,
    /// Binary cross entropy of the message.
    pub message: f32,
    /// Mean squared offsets, weighted as in the loss.
    pub offset: f32,
}

/// A step of the optimiser; its figures are those before its update.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Step {
    /// Counted from 1.
    pub step: usize,
    /// Most steps there will be.
    pub total: usize,
    /// Share of right bits in the step's training views.
    pub bit_accuracy: f64,
    /// Mean PSNR of these views, dB; infinite before anything has changed.
    pub psnr_db: f64,
    /// The loss.
    pub terms: LossTerms,
    /// Factor on the reconstruction terms.
    pub balance: f32,
}

/// A look at held-out views.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Check {
    /// After so many steps.
    pub step: usize,
    /// Mean share of right bits of a view.
    pub bit_accuracy: f64,
    /// Mean PSNR, dB; infinite when views are identical.
    pub psnr_db: f64,
    /// Mean logit of the weakest bit, negative when it is wrong.
    pub margin: f64,
}

/// Where the wall time of a step went, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct StepTimes {
    /// New views: projected, sorted, weighed, and drawn as they are unmarked.
    pub prepare: f64,
    /// Colours of visible Gaussians.
    pub colours: f64,
    /// Pictures.
    pub render: f64,
    /// The loss, and its gradient to the pictures.
    pub loss: f64,
    /// The gradient to colours.
    pub backward: f64,
    /// The gradient to coefficients.
    pub sh_backward: f64,
    /// The optimiser.
    pub optimiser: f64,
    /// A look at held-out views, in steps that have one.
    pub check: f64,
}

/// What is going on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "stage", rename_all = "snake_case")]
pub enum Progress {
    /// The scene was read, and the job fits in memory; this much it will need.
    Admitted(MemoryRequirements),
    /// It is known which Gaussians training views show.
    Covered {
        /// Views that were looked at.
        views: usize,
        /// Gaussians that some of them shows: those that are learned.
        seen: usize,
        /// Gaussians of the scene.
        gaussians: usize,
    },
    /// A step is done.
    Step(Step),
    /// Held-out views were read.
    Check(Check),
    /// A step has ended, with the look at held-out views, and took so long.
    Timed(StepTimes),
    /// The held-out margin holds after so many steps, so there will be no more.
    Stopped {
        /// Steps done.
        step: usize,
    },
    /// The file is being written and read back.
    Writing,
    /// So many views of the file are verified.
    Verifying {
        /// Views done.
        done: usize,
        /// Views in all.
        total: usize,
    },
}
