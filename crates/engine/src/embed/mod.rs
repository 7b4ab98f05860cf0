//! Embedding: learns small changes of a scene's colours that make its views read as a message.
//!
//! Geometry and opacity are frozen. [`optimise`] is the loop, [`embed`] goes from file to verified file.
mod adam;
mod alteration;
mod augment;
mod balance;
mod check;
mod descent;
mod learn;
mod learned;
mod loss;
pub mod natural;
mod needs;
mod new_hidden_key;
mod new_key;
mod optimise;
mod output;
mod pool;
mod preset;
mod progress;
mod settings;
mod shown;
mod target;
mod timing;
mod verify;

pub use adam::{Adam, AdamOptions, Penalty};
pub use augment::Augmentation;
pub use balance::{Balance, Balancer, Yielding};
pub use descent::{Descent, DescentOptions};
pub use learn::Learn;
pub use learned::Learned;
pub use needs::{ModelBytes, SceneSize, ViewSize, needs, needs_to_render};
pub use new_hidden_key::{HIDDEN, HiddenKeyOptions, create_hidden_key};
pub use new_key::{NewKey, create_key};
pub use optimise::{Optimised, optimise};
pub use output::{Job, Outcome, embed};
pub use pool::Coverage;
pub use preset::Preset;
pub use progress::{Check, Progress, Step, Terms};
pub use settings::{EarlyStop, Lambdas, Ring, Settings, Verify};
pub use target::Target;
pub use verify::{Verification, verify};
