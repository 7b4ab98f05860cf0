//! What was measured of one kind of mark under one attack, beside what is asked of it.
use std::collections::BTreeSet;

use crate::report::interval::wilson;
use crate::report::names::VAE;
use crate::report::record::{Claims, Mark};
use crate::report::selection::{Run, Selection};
use crate::report::summary::{Share, Summary};
use crate::report::targets::{Column, LINES, Target};

/// An attack on marks of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Case<'a> {
    pub column: Column,
    /// The line of the table; of attacks that nothing is asked of, what was done.
    pub line: &'a str,
    pub attack: &'a str,
    pub target: Option<Target>,
}

/// Over all scenes, or of one.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measured {
    pub summary: Summary,
    /// Marks that match from several pictures together, or whose whole message is right.
    pub together: Option<Share>,
}

/// Cases of a column: its lines, then what marks were read under besides.
pub(super) fn cases<'a>(column: Column, selection: &Selection<'a>) -> Vec<Case<'a>> {
    let case = |line: &'static str, attack: &'static str, target| Case {
        column,
        line,
        attack,
        target,
    };
    let mut cases: Vec<Case<'a>> = column
        .lines()
        .flat_map(|(line, target)| {
            line.attacks
                .iter()
                .map(move |attack| case(line.name, attack, Some(target)))
        })
        .collect();
    if column == Column::Robust {
        cases.push(case("VAE compression", VAE, None));
    }
    let known: BTreeSet<&str> = cases.iter().map(|case| case.attack).collect();
    let (bits, variant) = (column.bits(), column.variant());
    let on_pictures = |attack: &&str| super::is_of_pictures(attack) && !known.contains(attack);
    let read = |attack: &&str| !selection.runs(bits, variant, attack).is_empty();
    let more = selection.attacks().into_iter().filter(on_pictures).filter(read);
    // What is asked of another column only.
    let line_of = |attack: &'a str| {
        LINES
            .iter()
            .find(|line| line.attacks.contains(&attack))
            .map(|line| line.name)
    };
    let more: Vec<Case<'a>> = more
        .map(|attack| Case {
            column,
            line: line_of(attack).unwrap_or(attack),
            attack,
            target: None,
        })
        .collect();
    cases.extend(more);
    cases
}

impl Case<'_> {
    /// How a list of what is missing names it.
    pub fn name(&self) -> String {
        format!(
            "{} bits, {}, {}",
            self.column.bits(),
            self.column.variant(),
            self.attack
        )
    }

    /// Of all scenes, or of the one that is named.
    pub fn measured(&self, selection: &Selection<'_>, scene: Option<&str>) -> Measured {
        let is_of = |mark: &Mark| scene.is_none_or(|scene| mark.embedding.scene == scene);
        let (bits, variant) = (self.column.bits(), self.column.variant());
        let mut runs: Vec<Run<'_>> = selection.runs(bits, variant, self.attack);
        runs.retain(|run| is_of(run.mark));
        let summary = Summary::of(&runs);
        let together = match self.column.claims() {
            false => summary.whole.get(&self.column.pictures()).copied(),
            true => {
                let of_case = |(mark, claims): &(&Mark, &Claims)| {
                    (mark.embedding.bits, mark.embedding.variant.as_str()) == (bits, variant)
                        && is_of(mark)
                        && self.is_claim(claims)
                };
                let claims = selection.claims().into_iter().filter(of_case);
                share(claims.map(|(_, claims)| claims.matches() > 0))
            }
        };
        Measured { summary, together }
    }

    /// Whether these claims are the one about as many pictures as are read together here.
    fn is_claim(&self, claims: &Claims) -> bool {
        let pictures = self.column.pictures();
        claims.suspect == self.attack && claims.searched && (claims.views, claims.pool) == (pictures, pictures)
    }
}

fn share(tries: impl Iterator<Item = bool>) -> Option<Share> {
    let (right, of) = tries.fold((0, 0), |(right, of), success| (right + usize::from(success), of + 1));
    (of > 0).then(|| Share {
        right,
        of,
        interval: wilson(right, of),
    })
}
