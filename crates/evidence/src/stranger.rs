//! The same report for somebody who owns nothing of it: the verdict and its numbers, and nothing that helps to remove or
//! copy a mark.
use crate::evidence::{Audience, Evidence, Role};

impl Evidence {
    /// This report without what only an owner may see.
    ///
    /// Gone are the reading bit by bit with its logits and confidences (an attacker could climb them), payloads,
    /// originals and differences (they are the mark), the engine's notes, the worker's name, and the names of files that
    /// the reader did not send. Hashes and all that the p-value follows from stay.
    pub fn for_stranger(&self) -> Self {
        let mut report = self.clone();
        report.audience = Audience::Stranger;
        report.worker = None;
        if let Some(verification) = &mut report.verification {
            verification.strip.clear();
            verification.note = None;
            if let Some(found) = &mut verification.found {
                found.payload = None;
            }
        }
        if let Some(embedding) = &mut report.embedding {
            embedding.payload = None;
        }
        for input in &mut report.inputs {
            if input.role != Role::Suspect {
                input.name = None;
            }
        }
        for view in &mut report.views {
            view.original = None;
            view.difference = None;
        }
        report
    }
}
