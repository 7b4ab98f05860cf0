//! Scenes: Gaussians in memory, and the files of every common format that they come from.
//!
//! A scene that is written differs from the file that was read in nothing but its colours, and is of the same format.
//! Only the bands of spherical harmonics that hold something are in memory, whatever the file has room for.
//!
//! [`convert`] writes any Gaussians in any format, [`alter`] makes the changes that people make to scenes, and
//! [`quantize`] says what formats keep of colours: what a hidden mark has to stand.
pub mod alter;
mod atomic_write;
mod container;
pub mod convert;
mod error;
mod fields;
mod gaussians;
mod gltf;
mod ignored;
mod ksplat;
mod names;
mod packed;
mod ply;
pub mod quantize;
mod range;
mod remaining;
mod scene;
mod sniff;
mod sog;
mod splat;
mod spz;
mod summary;
#[doc(hidden)]
pub mod testing;

pub use atomic_write::{write_folder_whole, write_whole};
pub use container::Format;
pub use error::{Error, Result};
pub use gaussians::{Gaussians, MAX_DEGREE, Sh};
pub use gltf::{GltfCamera, gltf_cameras, is_binary_gltf};
pub use ignored::{BadRows, Ignored};
pub use scene::Scene;
pub use sniff::{HEAD, is_loose_sog, sniff, summary};
pub use sog::StreamedSog;
pub use summary::Summary;
