//! One mark, read from views under one attack.
use super::check::{bad, finite, maybe, named};
use super::id::{Id, Identity};
use super::mark::Mark;
use crate::error::Result;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What was read of a mark under an attack.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReadingRecord {
    /// The mark.
    pub mark: Id,
    /// The attack, such as [`crate::report::names::NONE`] or "jpeg:10".
    pub attack: String,
    /// Side of the views in pixels, before the attack.
    pub size: u32,
    /// Views that were read, at least 1.
    pub views: u32,
    /// Number of the first of them in the stream of held-out views.
    // Left out of JSON and identities where it is the first there is, so that older readings stay what they are.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub first_view: u32,
    /// Bits of the message.
    pub bits: u32,
    /// Bits read right, by view; each at most `bits`.
    pub bits_right: Vec<u16>,
    /// Whether the whole message was right when read from so many views together (their logits summed).
    pub message_right_from: BTreeMap<u32, bool>,
    /// PSNR of attacked against unattacked marked views in dB, mean over views; `None` if it was not measured or if
    /// they are identical.
    pub psnr_db: Option<f64>,
    /// Elevation of each view over the horizon in degrees, -90..=90, if it was kept.
    pub elevation_deg: Option<Vec<f32>>,
}

/// The identity of what is read of a mark under an attack; known before it is read. Side in pixels, views, and the number
/// of the first.
pub fn reading_id(mark: &Id, attack: &str, (size, views, first_view): (u32, u32, u32)) -> Id {
    let identity = Identity::of("reading")
        .text(mark.as_str())
        .text(attack)
        .number(size.into())
        .number(views.into());
    match first_view {
        0 => identity.id(),
        first => identity.number(first.into()).id(),
    }
}

fn is_zero(number: &u32) -> bool {
    *number == 0
}

impl ReadingRecord {
    /// Its identity.
    pub fn id(&self) -> Id {
        reading_id(&self.mark, &self.attack, (self.size, self.views, self.first_view))
    }

    /// Share of bits read right in one view, mean over views, 0..=1.
    pub fn accuracy(&self) -> f64 {
        let right: u64 = self.bits_right.iter().copied().map(u64::from).sum();
        right as f64 / (self.bits_right.len() as f64 * f64::from(self.bits))
    }

    /// Share of bits read right in the worst view, 0..=1.
    pub fn worst_accuracy(&self) -> f64 {
        let right = self.bits_right.iter().copied().min().unwrap_or(0);
        f64::from(right) / f64::from(self.bits)
    }

    pub(super) fn check(&self) -> Result<()> {
        named("attack", &self.attack)?;
        if self.views == 0 || self.bits_right.len() as u64 != u64::from(self.views) {
            let counted = self.bits_right.len();
            return bad("bits_right", format!("{counted} counts for {} views", self.views));
        }
        if self.bits == 0 || self.size == 0 {
            return bad("bits", format!("{} bits in views of {} pixels", self.bits, self.size));
        }
        if let Some(right) = self.bits_right.iter().find(|right| u32::from(**right) > self.bits) {
            return bad("bits_right", format!("{right} of {} bits", self.bits));
        }
        if let Some(views) = self.message_right_from.keys().find(|n| !(1..=self.views).contains(n)) {
            return bad("message_right_from", format!("{views} of {} views", self.views));
        }
        maybe("psnr_db", self.psnr_db, finite)?;
        let Some(degrees) = &self.elevation_deg else {
            return Ok(());
        };
        if degrees.len() != self.bits_right.len() {
            return bad(
                "elevation_deg",
                format!("{} elevations for {} views", degrees.len(), self.views),
            );
        }
        match degrees.iter().find(|degree| !(-90.0..=90.0).contains(*degree)) {
            Some(degree) => bad("elevation_deg", format!("{degree} is not within -90..=90")),
            None => Ok(()),
        }
    }

    /// Whether it can be of this mark.
    ///
    /// # Errors
    /// [`crate::Error::BadOption`] if the mark has another number of bits.
    pub(in crate::report) fn check_against(&self, mark: &Mark) -> Result<()> {
        if self.bits == mark.embedding.bits {
            return Ok(());
        }
        bad(
            "bits",
            format!("{} read of a mark of {} bits", self.bits, mark.embedding.bits),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{Change, mark, reading};

    #[test]
    fn accuracy_is_the_share_of_bits_by_view() {
        let mark = mark("lego", 16, "standard", 1);
        let reading = reading(&mark, "none", &[16, 12, 8]);
        reading.check().unwrap();
        assert_eq!(reading.accuracy(), 36.0 / 48.0);
        assert_eq!(reading.worst_accuracy(), 0.5);
    }

    #[test]
    fn mark_attack_size_and_views_identify() {
        let mark = mark("lego", 16, "standard", 1);
        let first = reading(&mark, "none", &[16, 12]);
        let mut better = first.clone();
        better.bits_right = vec![16, 16];
        assert_eq!(first.id(), better.id());
        assert_eq!(first.id(), reading_id(&mark.id(), "none", (first.size, 2, 0)));
        assert_ne!(first.id(), reading_id(&mark.id(), "none", (first.size, 3, 0)));
        assert_ne!(first.id(), reading_id(&mark.id(), "none", (1, 2, 0)));
        assert_ne!(first.id(), reading_id(&mark.id(), "jpeg:10", (first.size, 2, 0)));
        assert_ne!(first.id(), reading_id(&first.id(), "none", (first.size, 2, 0)));
        assert_ne!(first.id(), reading_id(&mark.id(), "none", (first.size, 2, 28)));
    }

    #[test]
    fn impossible_readings_are_refused() {
        let mark = mark("lego", 16, "standard", 1);
        let changes: [Change<ReadingRecord>; 6] = [
            ("bits_right", |r| r.views = 3),
            ("bits_right", |r| r.bits_right = vec![17, 0]),
            ("message_right_from", |r| {
                r.message_right_from.insert(5, true);
            }),
            ("psnr_db", |r| r.psnr_db = Some(f64::NAN)),
            ("elevation_deg", |r| r.elevation_deg = Some(vec![1.0])),
            ("elevation_deg", |r| r.elevation_deg = Some(vec![1.0, f32::NAN])),
        ];
        for (field, change) in changes {
            let mut broken = reading(&mark, "none", &[16, 12]);
            change(&mut broken);
            let reason = broken.check().unwrap_err().to_string();
            assert!(reason.starts_with(field), "{field}: {reason}");
        }
    }
}
