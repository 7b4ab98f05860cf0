//! Embedding: learns small changes of a scene's colours that make its views read as a message.
//!
//! Geometry and opacity are frozen. [`optimise`] is the loop, [`embed`] goes from file to verified file.
mod adam;
mod aside;
mod augment;
mod early_stopping;
mod embed_file;
mod embed_gaussians;
mod for_scene;
mod forecast;
mod image_augmentation;
mod learned_offsets;
mod loss;
mod loss_weight_controller;
mod marking;
mod optimise;
mod optimizer;
mod preconditioned_sgd;
mod preset;
mod progress;
mod resources;
mod scene_augmentation;
mod settings;
mod step_timer;
mod target;
mod trainable;
mod verify;
mod view_pool;

pub use adam::{Adam, AdamOptions, Penalty};
pub use augment::Augmentation;
pub use embed_file::{Job, embed, embed_level, embed_with_files};
pub use embed_gaussians::embed_gaussians;
pub use forecast::{Forecast, forecast};
pub use learned_offsets::LearnedOffsets;
pub use loss_weight_controller::{LossWeightControl, LossWeightController, TargetRelaxation};
pub use marking::Outcome;
pub use optimise::{Optimised, optimise};
pub use optimizer::Optimizer;
pub use preconditioned_sgd::{PreconditionedSgd, PreconditionedSgdOptions};
pub use preset::Preset;
pub use progress::{Check, LossTerms, Progress, Step, StepTimes};
pub use resources::{measure_view, measure_view_on_cpu, predict_memory};
pub use settings::{EarlyStop, Extension, LossWeights, Ring, Settings, Verify};
pub use target::Target;
pub use trainable::TrainableCoefficients;
pub use verify::{Verification, verify};
pub use view_pool::Coverage;
