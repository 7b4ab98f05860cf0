//! Whether a picture looks as if something were hidden in it, as an adversary without a key would ask.
//!
//! Two kinds of judges: the four detectors of StegExpose and their fusion, which look for replaced least significant
//! bits only, and [`learned`], which is shown marked pictures and looks for whatever differs.
//!
//! On crops of photographs, the area under the ROC curve of the fusion is 1.00 for replaced bits in half of the samples and
//! 0.98 in a fifth; that of [`learned`], trained on other photographs, is 1.00 for half of the samples changed by 1 and for
//! a tenth. A method that changes colours without a regard for their last bits can be expected to pass the former and must
//! be measured with the latter.
mod channel;
mod chi_square;
pub mod control;
mod detector;
mod judge;
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
pub use judge::{DetectionResult, DetectorInputs, Pairs, Steganalyzer, judge};
pub use roc::{DetectorRoc, roc_of};
