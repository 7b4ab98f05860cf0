//! What of a report follows from other parts of it, computed again.
use crate::evidence::Evidence;
use crate::picture::{Picture, View};
use crate::verification::{Reason, Test, Verification};
use guardsplat_codeword::{Message, Reading, Verdict, chance};
use std::fmt::Debug;

/// One thing that was computed again.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What it is.
    pub what: String,
    /// What the report says.
    pub stated: String,
    /// What follows from the rest of it.
    pub recomputed: String,
    /// Whether the two agree; p-values up to 1e-9 of their size.
    pub agrees: bool,
}

impl Evidence {
    /// Computes again what follows from other parts of the report.
    pub fn recompute(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        if let Some(verification) = &self.verification {
            verification.recompute(&mut findings);
        }
        findings.extend(self.views.iter().filter_map(View::recompute));
        findings
    }
}

impl Verification {
    fn recompute(&self, findings: &mut Vec<Finding>) {
        let Some(decision) = &self.decision else { return };
        let payable = self.tried.parts().into_iter().map(|tries| self.tried.hypotheses(tries));
        let payable: Vec<u64> = payable.collect();
        let paid = payable.iter().find(|hypotheses| **hypotheses == decision.hypotheses);
        let paid = *paid.or(payable.first()).unwrap_or(&1);
        findings.push(Finding::of("hypotheses", decision.hypotheses, paid));
        findings.push(Finding::of(
            "no more tried than the rate pays for",
            true,
            self.tried.rate_given() <= 1.0 + 1e-9,
        ));
        let fresh = decision.clone().computed();
        findings.push(Finding::number(
            "p-value of one hypothesis",
            decision.p_single,
            fresh.p_single,
        ));
        // From what is stated, since one wrong number is one finding.
        let p_value = chance::any_of(decision.p_single, decision.hypotheses);
        findings.push(Finding::number("p-value", decision.p_value, p_value));
        let needed = match decision.test() {
            Test::SignedRank(_) => "needed rank sum",
            Test::Counted => "needed bits",
        };
        findings.push(Finding::of(needed, decision.needed, fresh.needed));
        // To decide nothing is always allowed, with a reason that no number contradicts.
        let cautious = !matches!(self.reason, None | Some(Reason::TooFewBits | Reason::TooManyHypotheses));
        let verdict = if cautious { self.verdict } else { decision.verdict() };
        findings.push(Finding::of("verdict", self.verdict, verdict));
        if let Some(history) = &self.history {
            // A file from before the asset can't carry its mark, whatever the numbers say.
            let allowed = !(self.verdict == Verdict::Match && history.registered_later());
            findings.push(Finding::of(
                "an asset older than its suspect, of a match",
                true,
                allowed,
            ));
        }
        let known = self.strip.iter().filter_map(|bit| Some((bit.wanted?, bit.read)));
        let same: Vec<bool> = known.map(|(wanted, read)| wanted == read).collect();
        if !same.is_empty() {
            let matched = same.iter().filter(|same| **same).count();
            findings.push(Finding::of("matches of the strip", decision.matched as usize, matched));
        }
        if let (Some(stated), Some(recomputed)) = (decision.rank_sum, self.rank_sum_of_strip()) {
            findings.push(Finding::of("rank sum of the strip", stated, recomputed));
        }
    }

    /// The rank sum that the strip shows; `None` where it does not have all logits, or no bits that were wanted.
    fn rank_sum_of_strip(&self) -> Option<u32> {
        self.strip.iter().find(|bit| bit.wanted.is_some())?;
        let logits: Option<Vec<f32>> = self.strip.iter().map(|bit| Some(bit.logit? as f32)).collect();
        // A bit that was undecided has no wanted one, and matches nothing whatever it is.
        let wanted: Vec<bool> = self.strip.iter().map(|bit| bit.wanted.unwrap_or(bit.read)).collect();
        let reading = Reading::from_logits(&logits?).ok()?;
        reading.rank_sum(&Message::from_bits(&wanted).ok()?).ok()
    }
}

impl View {
    /// Whether the difference is that of the two pictures; `None` where one of the three has no bytes.
    fn recompute(&self) -> Option<Finding> {
        let (original, difference) = (self.original.as_ref()?, self.difference.as_ref()?);
        for picture in [original, &self.read, difference] {
            picture.png()?;
        }
        let fresh = Picture::difference(original, &self.read).and_then(|p| Ok(p.rgb()? == difference.rgb()?));
        let (recomputed, agrees) = match fresh {
            Ok(true) => ("the same pixels".to_owned(), true),
            Ok(false) => ("other pixels".to_owned(), false),
            Err(error) => (error.to_string(), false),
        };
        Some(Finding {
            what: format!("difference of {}", self.name),
            stated: "ten times the difference".into(),
            recomputed,
            agrees,
        })
    }
}

impl Finding {
    /// Whether a page has the pictures that its evidence names, with their sizes, and no `others`.
    pub(crate) fn pictures(evidence: Option<&Evidence>, others: usize) -> Self {
        let all: Vec<&Picture> = evidence
            .iter()
            .flat_map(|e| &e.views)
            .flat_map(|v| v.pictures().map(|(_, p)| p))
            .collect();
        let fine = |p: &Picture| {
            let again = p.png().and_then(|png| Picture::from_png(png.to_vec()).ok());
            again.is_some_and(|again| again == *p)
        };
        // A page may leave pictures out, all of them, if it was made from JSON.
        let there = all.iter().filter(|p| p.png().is_some()).count();
        let right = all.iter().filter(|p| fine(p)).count();
        Self {
            what: "pictures inside the page".into(),
            stated: format!("{} with their hashes", all.len()),
            recomputed: format!(
                "{right} as named, {} absent, {others} that no view names",
                all.len() - there
            ),
            agrees: others == 0 && right == there && (there == all.len() || there == 0),
        }
    }

    fn of<T: Debug + PartialEq>(what: &str, stated: T, recomputed: T) -> Self {
        Self {
            what: what.into(),
            agrees: stated == recomputed,
            stated: format!("{stated:?}"),
            recomputed: format!("{recomputed:?}"),
        }
    }

    fn number(what: &str, stated: f64, recomputed: f64) -> Self {
        Self {
            what: what.into(),
            agrees: (stated - recomputed).abs() <= 1e-9 * recomputed,
            stated: format!("{stated:e}"),
            recomputed: format!("{recomputed:e}"),
        }
    }
}
