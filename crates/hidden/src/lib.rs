//! A decoder in the manner of HiDDeN (Zhu et al. 2018, arXiv 1807.09937): a small convolutional network that reads bits
//! from pictures.
//!
//! [`train`] makes one, together with an encoder that is only needed for that; [`Weights`] keep it; a [`Network`] reads
//! pictures with it, frozen but differentiable in the pictures, so that a scene can be optimised until its views carry
//! a message. It is the second way to mark scenes, to compare the engine's own with.
//!
//! Pictures are tensors `[b, 3, h, w]` in [0, 1]. Random numbers have explicit seeds.
mod adam;
mod decoder;
mod encoder;
mod error;
mod geometry;
mod measure;
mod network;
mod parameter;
mod synthetic;
mod training;
mod weights;

pub use error::{Error, Result};
pub use geometry::Geometry;
pub use measure::Measured;
pub use network::{MAX_SIDE, MIN_SIDE, Network};
pub use synthetic::Synthetic;
pub use training::{Options, Progress, Trained, train};
pub use weights::{MAX_BITS, Named, Weights};
