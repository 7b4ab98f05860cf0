//! What a report can't say: values out of range, texts and lists beyond the limits, parts that exclude each other.
//!
//! Whether numbers agree with each other is another matter, which a check tells: a report that is wrong can be read.
use crate::embedding::Embedding;
use crate::error::{Error, Result};
use crate::evidence::{
    ALIKE_VERSION, BLIND_VERSION, COUNTED_VERSION, Evidence, EvidenceKind, FIRST_VERSION, SCHEMA, VERSION,
};
use crate::history::History;
use crate::limits::{BITS, FRAMINGS, INPUTS, NAME_BYTES, NOTE_BYTES, NOTES, PICTURE_SIDE, PICTURES_BYTES, VIEWS};
use crate::tried::{HypothesisKind, Tried};
use crate::verification::{Decision, Reason, Test, Verification};
use guardsplat_codeword::{Verdict, signed_rank};

impl Evidence {
    /// Whether everything is in range; see [`Evidence::to_json`].
    pub(crate) fn validate(&self) -> Result<()> {
        if self.schema != SCHEMA {
            return Err(Error::field("schema", format!("it must be {SCHEMA}")));
        }
        if !(FIRST_VERSION..=VERSION).contains(&self.version) {
            let (found, known) = (u64::from(self.version), VERSION);
            return Err(Error::UnknownVersion { found, known });
        }
        let names = [
            ("job", &self.job),
            ("engine", &self.engine),
            ("device", &self.device),
            ("model.name", &self.model.name),
            ("key.id", &self.key.id),
        ];
        names.iter().try_for_each(|(field, text)| name(field, text))?;
        if self.finished < self.started {
            return Err(Error::field("finished", "it is before the start"));
        }
        count("inputs", self.inputs.len(), INPUTS)?;
        for (i, input) in self.inputs.iter().enumerate() {
            let field = format!("inputs[{i}].name");
            input.name.iter().try_for_each(|text| name(&field, text))?;
        }
        match (self.kind, &self.verification, &self.embedding) {
            (EvidenceKind::Verify, None, _) => return Err(Error::field("verification", "a verify job has one")),
            (EvidenceKind::Verify, _, Some(_)) => return Err(Error::field("embedding", "a verify job has none")),
            (EvidenceKind::Embed, _, None) => return Err(Error::field("embedding", "an embed job has one")),
            _ => {}
        }
        if let Some(worker) = &self.worker {
            name("worker.name", &worker.name)?;
            if worker.attempt == 0 {
                return Err(Error::field("worker.attempt", "it must be at least 1"));
            }
        }
        self.validate_version()?;
        self.validate_ranks()?;
        let mut tried = self.verification.iter().map(|found| &found.tried);
        tried.try_for_each(|tried| self.validate_shares(tried))?;
        self.verification.iter().try_for_each(Verification::validate)?;
        self.embedding.iter().try_for_each(Embedding::validate)?;
        self.validate_views()
    }

    /// Whether it has what reports of its version have: what is missing must not read as if nothing had been tried.
    fn validate_version(&self) -> Result<()> {
        let Some(verification) = &self.verification else {
            return Ok(());
        };
        let (paid, history) = (verification.tried.paid, &verification.history);
        if self.version > FIRST_VERSION {
            if self.kind == EvidenceKind::Verify && paid.is_none() {
                return Err(Error::field(
                    "verification.tried.paid",
                    "a verify job has it since version 2",
                ));
            }
            if self.kind == EvidenceKind::Verify && history.is_none() {
                return Err(Error::field(
                    "verification.history",
                    "a verify job has it since version 2",
                ));
            }
            return Ok(());
        }
        let later = [
            ("worker", self.worker.is_some()),
            ("verification.tried.paid", paid.is_some()),
            ("verification.history", history.is_some()),
            (
                "verification.reason",
                verification.reason == Some(Reason::RegisteredLater),
            ),
        ];
        match later.into_iter().find(|(_, there)| *there) {
            Some((field, _)) => Err(Error::field(field, "version 1 has no such thing")),
            None => Ok(()),
        }
    }

    /// Whether it has the rank sum that it was decided by, since version 4.
    fn validate_ranks(&self) -> Result<()> {
        let decision = self.verification.as_ref().and_then(|found| found.decision.as_ref());
        let reason = match decision.map(|decision| (decision.test(), self.version > COUNTED_VERSION)) {
            Some((Test::SignedRank(_), false)) => "bits are ranked since version 4",
            Some((Test::Counted, true)) => "a decision has it since version 4",
            _ => return Ok(()),
        };
        Err(Error::field("verification.decision.rank_sum", reason))
    }

    /// Whether it says what each reading paid for, since version 3, where not all pay alike.
    fn validate_shares(&self, tried: &Tried) -> Result<()> {
        let field = || "verification.tried.framings".to_owned();
        let shared = self.version > ALIKE_VERSION;
        for group in &tried.framings {
            let reason = match (group.tries, group.pooled) {
                (Some(0), _) => "a part of the rate is one of at least one",
                (Some(_), _) if !shared => "readings share the rate since version 3",
                (Some(_), true) => "what was pooled has no part of the rate",
                (None, false) if shared => "each reading has a part of the rate since version 3",
                _ if group.kind == HypothesisKind::Estimated && !shared => "an estimate is told since version 3",
                _ if group.kind == HypothesisKind::Led && self.version <= COUNTED_VERSION => {
                    "that one picture leads is told since version 4"
                }
                _ if group.kind == HypothesisKind::Registered && self.version <= BLIND_VERSION => {
                    "pictures are compared with the original since version 5"
                }
                _ => continue,
            };
            return Err(Error::field(field(), reason));
        }
        Ok(())
    }

    fn validate_views(&self) -> Result<()> {
        count("views", self.views.len(), VIEWS)?;
        let mut bytes = 0;
        for (i, view) in self.views.iter().enumerate() {
            name(&format!("views[{i}].name"), &view.name)?;
            for (what, picture) in view.pictures() {
                if ![picture.width, picture.height]
                    .iter()
                    .all(|n| (1..=PICTURE_SIDE).contains(n))
                {
                    let reason = format!("{what} has a side outside of 1 to {PICTURE_SIDE} pixels");
                    return Err(Error::field(format!("views[{i}]"), reason));
                }
                bytes += picture.png().map_or(0, <[u8]>::len);
            }
        }
        if bytes > PICTURES_BYTES {
            return Err(Error::TooLarge {
                what: "all pictures together".into(),
                bytes: bytes as u64,
                limit: PICTURES_BYTES as u64,
            });
        }
        Ok(())
    }
}

impl Verification {
    fn validate(&self) -> Result<()> {
        let field = |name: &str| format!("verification.{name}");
        self.note.iter().try_for_each(|text| note(&field("note"), text))?;
        if self.reason.is_some() != (self.verdict == Verdict::Inconclusive) {
            let reason = "an inconclusive verdict, and no other, has one";
            return Err(Error::field(field("reason"), reason));
        }
        if matches!(self.verdict, Verdict::Match | Verdict::NoMatch) && self.decision.is_none() {
            return Err(Error::field(field("decision"), "such a verdict has one"));
        }
        if self.verdict == Verdict::UnknownKey && (self.decision.is_some() || !self.strip.is_empty()) {
            let reason = "nothing can be read with an unknown key";
            return Err(Error::field(field("decision"), reason));
        }
        if self.found.is_some() && self.verdict != Verdict::Match {
            return Err(Error::field(field("found"), "only a match has one"));
        }
        count(&field("tried.framings"), self.tried.framings.len(), FRAMINGS)?;
        if self.tried.framings.iter().any(|f| f.variants == 0) {
            return Err(Error::field(
                field("tried.framings"),
                "a framing has at least one variant",
            ));
        }
        if let Some(found) = &self.found {
            name(&field("found.owner"), &found.owner)?;
            name(&field("found.asset"), &found.asset)?;
            payload(&field("found.payload"), found.payload.as_deref())?;
        }
        if self.tried.paid.is_some_and(|paid| paid.readings == 0) {
            return Err(Error::field(field("tried.paid.readings"), "this one counts"));
        }
        self.history.iter().try_for_each(History::validate)?;
        count(&field("strip"), self.strip.len(), BITS)?;
        for (i, bit) in self.strip.iter().enumerate() {
            let field = |name: &str| format!("verification.strip[{i}].{name}");
            bit.confidence
                .iter()
                .try_for_each(|c| range(&field("confidence"), *c, 0.0, 1.0))?;
            bit.logit
                .iter()
                .try_for_each(|l| range(&field("logit"), *l, f64::MIN, f64::MAX))?;
        }
        let Some(decision) = &self.decision else { return Ok(()) };
        decision.validate()?;
        if !self.strip.is_empty() && self.strip.len() != decision.bits as usize {
            let reason = format!("it has {} bits, {} were compared", self.strip.len(), decision.bits);
            return Err(Error::field(field("strip"), reason));
        }
        Ok(())
    }
}

impl History {
    fn validate(&self) -> Result<()> {
        let field = |name: &str| format!("verification.history.{name}");
        let Some(asset) = &self.asset else { return Ok(()) };
        name(&field("asset.asset"), &asset.asset)?;
        name(&field("asset.commitment"), &asset.commitment)
    }
}

impl Decision {
    fn validate(&self) -> Result<()> {
        let field = |name: &str| format!("verification.decision.{name}");
        if self.bits == 0 || self.bits as usize > BITS {
            return Err(Error::field(field("bits"), format!("it must be 1 to {BITS}")));
        }
        let counts = [
            ("matched", Some(self.matched)),
            ("corrected", self.corrected),
            ("needed", self.needed.filter(|_| self.test() == Test::Counted)),
        ];
        for (name, number) in counts {
            if number.is_some_and(|n| n > self.bits) {
                return Err(Error::field(field(name), format!("there are {} bits only", self.bits)));
            }
        }
        let largest = signed_rank::largest(self.bits);
        let sums = [("rank_sum", self.rank_sum), ("needed", self.needed)];
        for (name, number) in sums {
            if number.is_some_and(|n| n > largest) {
                let reason = format!("the ranks of {} bits add up to {largest} only", self.bits);
                return Err(Error::field(field(name), reason));
            }
        }
        if self.hypotheses == 0 {
            return Err(Error::field(field("hypotheses"), "it must be at least 1"));
        }
        range(&field("p_single"), self.p_single, 0.0, 1.0)?;
        range(&field("p_value"), self.p_value, 0.0, 1.0)?;
        range(&field("threshold"), self.threshold, 1e-30, 0.1)
    }
}

impl Embedding {
    fn validate(&self) -> Result<()> {
        let field = |name: &str| format!("embedding.{name}");
        payload(&field("payload"), self.payload.as_deref())?;
        range(&field("bit_accuracy"), self.bit_accuracy, 0.0, 1.0)?;
        let worst = self.bit_accuracy_worst_view;
        range(&field("bit_accuracy_worst_view"), worst, 0.0, 1.0)?;
        range(&field("ssim"), self.ssim, -1.0, 1.0)?;
        let target = &self.target;
        let optional = [
            ("psnr_db", self.psnr_db, -200.0, 200.0),
            ("lpips", self.lpips, 0.0, 100.0),
            ("target.bit_accuracy", target.bit_accuracy, 0.0, 1.0),
            ("target.psnr_db", target.psnr_db, -200.0, 200.0),
            ("target.ssim", target.ssim, -1.0, 1.0),
            ("target.lpips", target.lpips, 0.0, 100.0),
        ];
        for (name, value, low, high) in optional {
            value.iter().try_for_each(|v| range(&field(name), *v, low, high))?;
        }
        if self.changed_gaussians > self.gaussians {
            let reason = format!("there are {} Gaussians only", self.gaussians);
            return Err(Error::field(field("changed_gaussians"), reason));
        }
        count(&field("missed"), self.missed.len(), NOTES)?;
        self.missed.iter().try_for_each(|text| note(&field("missed"), text))
    }
}

fn name(field: &str, text: &str) -> Result<()> {
    text_of(field, text, NAME_BYTES)
}

fn note(field: &str, text: &str) -> Result<()> {
    text_of(field, text, NOTE_BYTES)
}

fn text_of(field: &str, text: &str, limit: usize) -> Result<()> {
    if text.is_empty() || text.len() > limit {
        let reason = format!("it has {} bytes, it must have 1 to {limit}", text.len());
        return Err(Error::field(field, reason));
    }
    Ok(())
}

fn payload(field: &str, text: Option<&str>) -> Result<()> {
    let digits = BITS.div_ceil(4);
    let fine = |t: &str| (1..=digits).contains(&t.len()) && t.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
    if text.is_some_and(|t| !fine(t)) {
        let reason = format!("it must be 1 to {digits} digits of lower-case hexadecimal");
        return Err(Error::field(field, reason));
    }
    Ok(())
}

fn count(field: &str, found: usize, limit: usize) -> Result<()> {
    if found > limit {
        return Err(Error::field(
            field,
            format!("it has {found} entries, at most {limit} are taken"),
        ));
    }
    Ok(())
}

fn range(field: &str, value: f64, low: f64, high: f64) -> Result<()> {
    // NaN is outside of every range.
    if !(low..=high).contains(&value) {
        return Err(Error::field(field, format!("{value} is outside of {low} to {high}")));
    }
    Ok(())
}
