//! Claims about one suspect: right ones, and wrong ones that must not match.
use super::check::{bad, named, share};
use super::id::{Id, Identity};
use crate::error::Result;
use serde::{Deserialize, Serialize};

/// Powers of ten whose shares are counted: p at or below 10^-1 to 10^-6.
pub const POWERS: usize = 6;

/// Claims that were made about pictures of a mark, or of the scene without it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Claims {
    /// The mark that was looked for.
    pub mark: Id,
    /// What was looked at: see [`crate::report::names::SCENE`] and [`crate::report::names::UNMARKED`]; anything else is
    /// what was done to pictures of the mark.
    pub suspect: String,
    /// Whether everything that may have been done to pictures was searched, or they were read as given only.
    pub searched: bool,
    /// Side of the views in pixels, before anything was done to them.
    pub size: u32,
    /// Views that there were.
    pub views: u32,
    /// Views that a claim is about, each view in one claim only.
    pub pool: u32,
    /// Most framings that a claim paid for.
    pub framings: u32,
    /// The rate of false positives that right claims were decided at.
    pub rate: f64,
    /// The p-value of each right claim; none of what is not marked.
    pub p_values: Vec<f64>,
    /// Right claims whose payload was read as it is registered.
    pub payloads: u32,
    /// Wrong claims about the same views: other keys, other assets.
    pub wrong: u64,
    /// How many of those had p <= 10^-k, for k from 1.
    pub wrong_at_most: [u64; POWERS],
    /// The same if the bits of two views were counted as independent, which is wrong; `None` for claims about one.
    pub wrong_as_trials: Option<[u64; POWERS]>,
}

impl Claims {
    /// Its identity.
    pub fn id(&self) -> Id {
        claims_id(
            &self.mark,
            &self.suspect,
            self.searched,
            (self.size, self.views, self.pool),
        )
    }

    /// Right claims that matched.
    pub fn matches(&self) -> usize {
        self.p_values.iter().filter(|p| **p <= self.rate).count()
    }

    /// What the claims were about, in words.
    pub fn told(&self) -> String {
        let read = if self.searched { "searched" } else { "as given" };
        format!("{} {read}, {} views", self.suspect, self.pool)
    }

    pub(super) fn check(&self) -> Result<()> {
        named("suspect", &self.suspect)?;
        if self.size == 0 || self.framings == 0 || self.pool == 0 || self.pool > self.views {
            return bad(
                "pool",
                format!(
                    "{} of {} views of {} pixels in {} framings",
                    self.pool, self.views, self.size, self.framings
                ),
            );
        }
        share("rate", self.rate)?;
        for p in &self.p_values {
            share("p_values", *p)?;
        }
        if self.p_values.len() > (self.views / self.pool) as usize {
            return bad(
                "p_values",
                format!("{} claims about {} views", self.p_values.len(), self.views),
            );
        }
        if self.payloads as usize > self.p_values.len() {
            return bad(
                "payloads",
                format!("{} of {} claims", self.payloads, self.p_values.len()),
            );
        }
        for counts in [Some(self.wrong_at_most), self.wrong_as_trials].into_iter().flatten() {
            let falling = counts.windows(2).all(|pair| pair[1] <= pair[0]);
            if !falling || counts[0] > self.wrong {
                return bad("wrong_at_most", format!("{counts:?} of {} claims", self.wrong));
            }
        }
        Ok(())
    }
}

/// The identity of claims; known before they are made. Side in pixels, views, and views a claim.
pub fn claims_id(mark: &Id, suspect: &str, searched: bool, (size, views, pool): (u32, u32, u32)) -> Id {
    Identity::of("claims")
        .text(mark.as_str())
        .text(suspect)
        .number(searched.into())
        .number(size.into())
        .number(views.into())
        .number(pool.into())
        .id()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{Change, claims, mark};

    #[test]
    fn what_was_measured_does_not_identify() {
        let first = claims(&mark("lego", 64, "standard", 1), "none", true);
        let mut other = first.clone();
        (other.wrong, other.framings, other.payloads) = (9, 72, 0);
        assert_eq!(first.id(), other.id());
        other.searched = false;
        assert_ne!(first.id(), other.id());
        assert_eq!(first.matches(), 1);
    }

    #[test]
    fn impossible_claims_are_refused() {
        let mark = mark("lego", 64, "standard", 1);
        claims(&mark, "none", true).check().unwrap();
        let changes: [Change<Claims>; 7] = [
            ("suspect", |c| c.suspect.clear()),
            ("pool", |c| c.pool = 21),
            ("rate", |c| c.rate = 2.0),
            ("p_values", |c| c.p_values[0] = f64::NAN),
            ("p_values", |c| c.p_values = vec![0.5; 21]),
            ("payloads", |c| c.payloads = 3),
            ("wrong_at_most", |c| c.wrong_at_most[3] = 7),
        ];
        for (field, change) in changes {
            let mut broken = claims(&mark, "none", true);
            change(&mut broken);
            let reason = broken.check().unwrap_err().to_string();
            assert!(reason.starts_with(field), "{field}: {reason}");
        }
    }
}
