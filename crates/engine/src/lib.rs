//! The GuardSplat engine: marks a 3D Gaussian Splatting scene and reads the mark back from pictures of it.
mod card;
pub mod clip;
pub mod device;
pub mod embed;
pub mod error;
pub mod extract;
mod launch;
pub mod memory;
pub mod message;
pub mod models;
pub mod picture;
mod power;
pub mod quality;
pub mod resize;
pub mod sample;
mod simd;
pub mod splat;
pub mod stop;
#[doc(hidden)]
pub mod testing;
pub mod train;
pub mod view;

pub use error::{Error, Result};
pub use guardsplat_scene as scene;
