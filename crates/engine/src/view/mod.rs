//! Views: cameras from the scene itself or from a file.
mod camera;
mod colmap;
mod directions;
mod extent;
mod files;
mod focus;
mod given;
mod gltf;
mod ground;
mod inside;
mod json;
mod kind;
#[cfg(test)]
mod kinds_tests;
mod lattice;
mod openness;
mod orbit;
mod placing;
mod quantiles;
mod sampler;
mod sight;
mod solid;
mod vantage;
pub(crate) mod vector;

pub use camera::Camera;
pub use extent::Extent;
pub use files::{parse_cameras, read_cameras, write_cameras};
pub use given::GivenViews;
pub use inside::InsideViews;
pub use kind::SceneKind;
pub use openness::Openness;
pub use sampler::{Split, ViewSampler, Viewpoints};
pub use vantage::Vantage;
