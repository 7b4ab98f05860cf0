//! Views: cameras from the scene itself or from a file.
mod camera;
mod extent;
mod files;
mod json;
mod sampler;
pub(crate) mod vector;

pub use camera::Camera;
pub use extent::Extent;
pub use files::{parse_cameras, read_cameras, write_cameras};
pub use sampler::{Split, ViewSampler};
