//! What of a verification somebody is told. How near a suspect came tells whoever may ask again which change to it, or
//! which asset, is the better one: that is for admins. All others get the verdict and the reason.
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{Job, VerifyResult, VerifySpec};

use super::is_raw;
use crate::access::{Caller, Scope};

/// What somebody is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Disclosure {
    /// All of it.
    Everything,
    /// Verdict and reason, and every bit of raw verifications if the operator allows that.
    Verdict {
        /// Whether raw verifications are told in full.
        raw: bool,
    },
}

impl Disclosure {
    /// What a caller is told, where raw verification is allowed to everybody who verifies, or is not.
    pub fn to(caller: &Caller, raw: bool) -> Self {
        match caller.scopes.has(Scope::Admin) {
            true => Self::Everything,
            false => Self::Verdict { raw },
        }
    }

    /// A job as it is told.
    pub fn job(self, mut job: Job) -> Job {
        if let (Some(Spec::Verify(spec)), Some(Outcome::VerifyResult(result))) = (&job.spec, &mut job.result) {
            *result = self.result(spec, std::mem::take(result));
        }
        job
    }

    /// The result of a verification as it is told.
    pub fn result(self, spec: &VerifySpec, result: VerifyResult) -> VerifyResult {
        match self {
            Self::Everything => return result,
            Self::Verdict { raw } if raw && is_raw(spec) => return result,
            Self::Verdict { .. } => {}
        }
        let matches = result.verdict() == Verdict::Match;
        VerifyResult {
            redacted: true,
            // What it is at most. Any finer, and whoever changes a copy step by step sees each step.
            p_value: result.threshold.filter(|_| matches),
            matched_bits: None,
            rank_sum: None,
            corrected_bits: None,
            message: String::new(),
            bit_accuracy: None,
            bit_accuracy_worst_view: None,
            // These two say how clear the mark is, whatever is claimed.
            mean_abs_logit: 0.0,
            view_agreement: 0.0,
            framing: String::new(),
            // What error correction makes of a reading that is no match is not told in any case.
            ..result
        }
    }
}
