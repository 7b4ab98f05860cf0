//! Real attacks on 8-bit pictures: codecs, resampling, noise; never the stand-ins that training uses.
//!
//! An attack is written as text, `jpeg:10`, and may draw its strength anew for every picture, `rotate:-30..30`. Several
//! in a row are joined by `+`: `crop:0.6+brightness:1.3+jpeg:50`. [`AttackKind`] lists them with units and limits.
//!
//! Whatever is random follows from a seed and the index of the picture, so that every picture gets its own and gets it
//! again. Pictures are taken as they are stored, without linearising their colours, as nearly all software does. AVIF is
//! written and read by programs of the system ([`Attack::missing_program`]); HEIC is left out.
//!
//! ```
//! use guardsplat_evaluation::attack::Attack;
//! use image::RgbImage;
//!
//! let attack: Attack = "crop:0.6+brightness:0.5..1.5+jpeg:50".parse()?;
//! let attacked = attack.apply(&RgbImage::new(64, 50), 7, 0)?;
//! assert_eq!(attacked.dimensions(), (38, 30));
//! assert_eq!(attack.to_string(), "crop:0.6+brightness:0.5..1.5+jpeg:50");
//! # Ok::<(), guardsplat_evaluation::Error>(())
//! ```
mod amount;
mod avif;
mod chain;
mod codec;
mod colour;
mod cover;
mod draw;
mod filter;
mod frame;
mod kind;
mod libjpeg;
mod limits;
mod noise;
mod resample;
mod rotate;
mod size;
mod step;
mod strength;
mod suite;
#[doc(hidden)]
pub mod testing;
#[cfg(test)]
mod tests;

pub use chain::{Attack, MAX_STEPS};
pub use kind::AttackKind;
pub use size::{MAX_PIXELS, MAX_SIDE};
pub use step::Step;
pub use strength::Strength;
