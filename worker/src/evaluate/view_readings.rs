//! What was read of views: logits that are decided for, or candidates for what was done to pictures, which are chosen among
//! once it is known which pictures are read together.
use guardsplat_engine::extract::{PictureLogits, PooledLogits, estimates};

use crate::error::Result;

/// What was read of some views.
pub(super) enum ViewReadings {
    /// Logits of each, whatever the others are.
    Decided(PooledLogits),
    /// Candidates for what was done to each, which more views choose better.
    Estimated(Vec<PictureLogits>),
}

impl ViewReadings {
    /// Each view read by itself.
    pub fn each(&self) -> Result<PooledLogits> {
        match self {
            Self::Decided(logits) => Ok(logits.clone()),
            Self::Estimated(pictures) => {
                let alone = pictures
                    .iter()
                    .flat_map(|picture| estimated(std::slice::from_ref(picture)));
                Ok(PooledLogits::new(alone.collect())?)
            }
        }
    }

    /// The first `count` views, read together.
    pub fn of_first(&self, count: usize) -> Result<PooledLogits> {
        match self {
            Self::Decided(logits) => Ok(logits.of_first(count)?),
            Self::Estimated(pictures) => Ok(PooledLogits::new(estimated(&pictures[..count.min(pictures.len())]))?),
        }
    }
}

/// Logits of pictures, with the estimate of what was done to each undone.
fn estimated(pictures: &[PictureLogits]) -> Vec<Vec<f32>> {
    let chosen = estimates(pictures).into_iter().zip(pictures);
    let logits = chosen.map(|(estimate, picture)| estimate.map_or(picture.as_given(), |estimate| estimate.logits()));
    logits.map(<[f32]>::to_vec).collect()
}
