//! Whether a picture looks as if something were hidden in it, as an adversary without a key would ask.
//!
//! Two kinds of judges: the four detectors of StegExpose and their fusion, which look for replaced least significant
//! bits only, and [`learned`], which is shown marked pictures and looks for whatever differs.
mod channel;
mod chi_square;
mod detector;
pub mod learned;
mod primary_sets;
mod quadratic;
mod roc;
mod rs;
mod sample_pairs;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use detector::{Detector, NoResult};
pub use roc::{DetectorRoc, roc_of};
