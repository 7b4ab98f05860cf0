//! What a handful of measurements allows to say: summaries, intervals, ROC curves and Pareto fronts.
//!
//! Every function refuses NaN and infinity with [`Error::BadOption`], and says what it makes of none or one sample.
mod clustered;
mod clusters;
mod delong;
mod interval;
mod pareto;
mod proportion;
mod roc;
mod summary;

pub use clustered::{Cluster, clustered_area};
pub use clusters::{ClusterMean, bootstrap_mean, cluster_means, student_mean};
pub use interval::Interval;
pub use pareto::{Direction, pareto_front};
pub use proportion::{clopper_pearson, wilson};
pub use roc::{BalancedAccuracy, Roc, RocPoint};
pub use summary::Summary;

use crate::{Error, Result};

/// An [`Error::BadOption`].
pub(crate) fn bad(field: &'static str, reason: impl Into<String>) -> Error {
    Error::BadOption {
        field,
        reason: reason.into(),
    }
}

/// Refuses a sample with a value that is not finite.
fn check_finite(field: &'static str, values: &[f64]) -> Result<()> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(row) => Err(bad(field, format!("value {row} of {} is not finite", values.len()))),
    }
}
