//! What is kept of every run: marks, what was read of them, what detectors made of them, and claims about them.
//!
//! What identifies a record is known before it is measured, so that a resumed run can ask for it; results never count.
mod check;
mod claims;
mod detection;
mod id;
mod mark;
mod reading;
mod timing;

pub use claims::{Claims, POWERS, claims_id};
pub use detection::{Detection, detection_id};
pub use id::Id;
pub use mark::{Embedding, Mark};
pub use reading::{ReadingRecord, reading_id};
pub use timing::Timing;

use crate::error::Result;
use serde::{Deserialize, Serialize};

/// One line of a store.
#[allow(clippy::large_enum_variant)] // Records are passed on one by one, and kept by kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Record {
    /// One embedding.
    Mark(Mark),
    /// One mark, read under one attack.
    Reading(ReadingRecord),
    /// One detector, judging clean and marked pictures.
    Detection(Detection),
    /// Claims about one suspect, right and wrong ones.
    Claims(Claims),
}

impl Record {
    /// What identifies it; the same for every record of the same thing, whatever was measured.
    pub fn id(&self) -> Id {
        match self {
            Record::Mark(mark) => mark.id(),
            Record::Reading(reading) => reading.id(),
            Record::Detection(detection) => detection.id(),
            Record::Claims(claims) => claims.id(),
        }
    }

    /// Whether its numbers are possible: finite, within their ranges, and in keeping with each other.
    ///
    /// # Errors
    /// [`crate::Error::BadOption`] with the field, its value and the limit.
    pub fn check(&self) -> Result<()> {
        match self {
            Record::Mark(mark) => mark.check(),
            Record::Reading(reading) => reading.check(),
            Record::Detection(detection) => detection.check(),
            Record::Claims(claims) => claims.check(),
        }
    }
}
