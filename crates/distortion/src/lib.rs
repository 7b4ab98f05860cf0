//! Differentiable distortions of pictures, for training marks that stand them.
//!
//! A [`Layer`] distorts a batch of pictures, each in its own way: which distortions there are is told by
//! [`DistortionKind`], which a mark has to stand by [`RobustTo`], how strong they are by [`Ranges`], and what one picture
//! got by [`Draw`]. A [`Vae`] does to pictures what a learned codec does to them. Evaluation uses real codecs on 8-bit
//! pictures instead.
//!
//! Pictures are tensors `[b, 3, h, w]` in [0, 1] on any device. Random numbers come from the caller, and noise is drawn
//! on the host, so that the same seed gives the same distortions on every device.
mod blur;
mod brightness;
mod combined;
mod contrast;
mod crop;
mod draw;
mod error;
mod groups;
mod jpeg;
mod kind;
mod layer;
mod mask;
mod matrices;
mod noise;
mod ranges;
mod robust_to;
mod rotation;
mod rounding;
mod scaling;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod vae;

pub use combined::Combined;
pub use crop::Crop;
pub use draw::Draw;
pub use error::{Error, Result};
pub use jpeg::{Chroma, Jpeg};
pub use kind::DistortionKind;
pub use layer::Layer;
pub use mask::{MAX_RECTANGLES, Rectangle};
pub use noise::Noise;
pub use ranges::{CropRange, JpegRange, Ranges};
pub use robust_to::RobustTo;
pub use vae::Vae;
