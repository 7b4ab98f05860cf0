//! Views: cameras from the scene itself or from a file.
mod camera;
mod colmap;
mod extent;
mod files;
mod given;
mod json;
mod sampler;
pub(crate) mod vector;

pub use camera::Camera;
pub use extent::Extent;
pub use files::{parse_cameras, read_cameras, write_cameras};
pub use given::GivenViews;
pub use sampler::{Split, ViewSampler};
