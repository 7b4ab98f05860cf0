//! Embedding: learns small changes of a scene's colours that make its views read as a message.
//!
//! Geometry and opacity are frozen. [`optimise`] is the loop, [`embed`] goes from file to verified file.
mod adam;
mod augment;
mod early_stopping;
mod embed_file;
mod image_augmentation;
mod learned_offsets;
mod loss;
mod loss_weight_controller;
mod optimise;
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
pub use embed_file::{Job, Outcome, embed};
pub use learned_offsets::Learned;
pub use loss_weight_controller::{Balance, Balancer, Yielding};
pub use optimise::{Optimised, optimise};
pub use preconditioned_sgd::{Descent, DescentOptions};
pub use preset::Preset;
pub use progress::{Check, Progress, Step, Terms};
pub use resources::{measure_view, measure_view_on_cpu, predict_memory};
pub use settings::{EarlyStop, Lambdas, Ring, Settings, Verify};
pub use target::Target;
pub use trainable::Learn;
pub use verify::{Verification, verify};
pub use view_pool::Coverage;
