//! What a report does not prove, said before somebody else says it.
use crate::evidence::{Evidence, EvidenceKind};
use guardsplat_codeword::Verdict;
use maud::{Markup, html};

/// What does not follow from this report.
pub(super) fn section(evidence: &Evidence) -> Markup {
    let verdict = evidence.verification.as_ref().map(|v| v.verdict);
    let decided = evidence.verification.as_ref().is_some_and(|v| v.decision.is_some());
    html! {
        section {
            h2 { "What this report does not prove" }
            ul {
                @if decided {
                    li { "The p-value is not the probability that the suspect is unmarked, and nobody\u{2019}s probability of guilt. It
                        says how rarely an unrelated scene would agree this well." }
                    li { "Attempts that were made elsewhere are not counted, nor readings of changed copies of these files. Compare
                        the SHA-256 of the suspect with that of the file as it was published: a file that the claimant made says
                        little." }
                }
                @if verdict == Some(Verdict::Match) {
                    li { "A match says that the mark is there, not who put it there or when. That the message was the owner\u{2019}s before
                        publication takes a dated commitment, and of two marks in one scene the dates decide." }
                    li { "Marks can be copied from one scene to another. Whether the suspect shows the asset is for people to see." }
                }
                @if matches!(verdict, Some(Verdict::NoMatch | Verdict::Inconclusive | Verdict::UnknownKey)) {
                    li { "This does not say that the suspect is unmarked. A mark may be too weak or too much changed to be read, or be
                        of another key or message." }
                }
                @if evidence.kind == EvidenceKind::Embed {
                    li { "The figures are those of this file, seen from these views. What somebody does to the scene later is not in
                        them." }
                }
                li { "The signature says that the holder of the key vouches for this report as it is. It does not say that the clock of
                    the service was right, nor that the files were obtained lawfully." }
            }
        }
    }
}
