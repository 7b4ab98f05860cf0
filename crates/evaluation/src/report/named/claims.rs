//! Claims: how many right ones are found, and whether p-values of wrong ones are what they say.
use super::{Plot, Report};
use crate::error::Result;
use crate::report::interval::wilson;
use crate::report::names::{NONE, SCENE, UNMARKED};
use crate::report::plot::{Axes, Line, Point, lines};
use crate::report::record::{Claims, Mark, POWERS};
use crate::report::selection::Selection;
use crate::report::summary::Estimate;
use crate::report::table::{Cell, Row, Table};

const RIGHT: &str = "Rates in percent of the claims about a mark, mean over marks, in brackets 95 % intervals by Student's t: \
    claims about one mark are not independent. Each view is in one claim only. A match needs p <= 10^-6 with all framings \
    paid for; the payload is what the error-correcting code reads of a match.";
const WRONG: &str = "Shares of wrong claims, each with an owner's secret, an asset and a payload of its own, in brackets 95 % \
    intervals (Wilson 1927): given what was read, wrong claims are independent. \"Exactly\" is the largest tail of the \
    signed-rank distribution that is not above 10^-k. Where all framings are searched, \
    p-values are union bounds, and shares are below.";
const AS_TRIALS: &str = "Counting the bits of only two views as independent makes false claims; the column is there so that \
    nobody does it.";

/// What a row of right claims is of.
type Case<'a> = (&'a str, bool, u32);

pub(super) fn fill(report: &mut Report, selection: &Selection<'_>) -> Result<()> {
    let mut all = selection.claims();
    // Right ones without wrong ones beside them are told by robustness.
    all.retain(|(_, claims)| claims.wrong > 0);
    if all.is_empty() {
        report.missing.push("claims: not measured".into());
        return Ok(());
    }
    report.tables.push(Table {
        title: "Right claims".into(),
        columns: [
            "suspect",
            "read",
            "views a claim",
            "framings",
            "marks",
            "claims",
            "matches (%)",
            "payload read (%)",
            "median p-value",
        ]
        .map(String::from)
        .to_vec(),
        rows: cases(&all).into_iter().map(|case| right(case, &all)).collect(),
        notes: vec![RIGHT.into()],
    });
    wrong(report, &all)
}

/// Cases in the order in which they are told: scenes, pictures as they are, then what was done to them.
fn cases<'a>(all: &[(&'a Mark, &'a Claims)]) -> Vec<Case<'a>> {
    let mut cases: Vec<Case<'a>> = Vec::new();
    for (_, claims) in all {
        let case = (claims.suspect.as_str(), claims.searched, claims.pool);
        if claims.suspect != UNMARKED && !cases.contains(&case) {
            cases.push(case);
        }
    }
    let place = |name: &str| match name {
        SCENE => 0,
        NONE => 1,
        _ => 2,
    };
    cases.sort_by_key(|(name, searched, pool)| (place(name), *name, *searched, *pool));
    cases
}

fn right((suspect, searched, pool): Case<'_>, all: &[(&Mark, &Claims)]) -> Row {
    let of_case = |c: &Claims| (c.suspect.as_str(), c.searched, c.pool) == (suspect, searched, pool);
    let these: Vec<&Claims> = all.iter().map(|(_, c)| *c).filter(|c| of_case(c)).collect();
    let rate = |count: &dyn Fn(&Claims) -> usize| {
        let with_any = these.iter().filter(|c| !c.p_values.is_empty());
        let shares: Vec<f64> = with_any
            .map(|c| 100.0 * count(c) as f64 / c.p_values.len() as f64)
            .collect();
        let mut estimate = Estimate::of(&shares)?;
        estimate.interval = estimate.interval.map(|ends| ends.map(|end| end.clamp(0.0, 100.0)));
        Some(estimate)
    };
    let mut p: Vec<f64> = these.iter().flat_map(|c| c.p_values.iter().copied()).collect();
    p.sort_by(f64::total_cmp);
    let median = p.get(p.len().saturating_sub(1) / 2);
    Row::new(vec![
        Cell::text(suspect),
        Cell::text(if searched { "searched" } else { "as given" }),
        Cell::Count(pool.into()),
        Cell::Count(these.iter().map(|c| u64::from(c.framings)).max().unwrap_or(0)),
        Cell::Count(these.len() as u64),
        Cell::Count(p.len() as u64),
        Cell::estimate(rate(&Claims::matches), 1),
        Cell::estimate(rate(&|c| c.payloads as usize), 1),
        median.map_or(Cell::NotMeasured, |p| Cell::text(format!("{p:.1e}"))),
    ])
}

/// Wrong claims, counted in one way.
#[derive(Clone, Copy, Default)]
struct Counted {
    claims: u64,
    at_most: [u64; POWERS],
}

impl Counted {
    fn add(&mut self, claims: u64, counts: &[u64; POWERS]) {
        self.claims += claims;
        self.at_most.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
    }

    /// The share at 10^-k, `k` from 0 here, with its interval.
    fn share(&self, k: usize) -> Option<(f64, [f64; 2])> {
        let (count, of) = (self.at_most.get(k)?, self.claims);
        (of > 0).then(|| (*count as f64 / of as f64, wilson(*count as usize, of as usize)))
    }

    fn cell(&self, k: usize) -> Cell {
        self.share(k).map_or(Cell::NotMeasured, |(share, [low, high])| {
            Cell::text(format!("{share:.2e} ({low:.2e} to {high:.2e})"))
        })
    }

    /// Logarithms, as the plot has them; no share at all has none.
    fn line(&self, name: String) -> Line {
        let point = |k: usize| {
            let (share, [low, high]) = self.share(k).filter(|(share, _)| *share > 0.0)?;
            Some(Point {
                x: k as f64 + 1.0,
                y: share.log10(),
                interval: Some([low.log10(), high.log10()]),
            })
        };
        Line {
            name,
            points: (0..POWERS).filter_map(point).collect(),
            dots: true,
        }
    }
}

fn wrong(report: &mut Report, all: &[(&Mark, &Claims)]) -> Result<()> {
    let [mut as_given, mut searched, mut trials] = [Counted::default(); 3];
    for (_, claims) in all {
        let counted = if claims.searched { &mut searched } else { &mut as_given };
        counted.add(claims.wrong, &claims.wrong_at_most);
        if let Some(counts) = &claims.wrong_as_trials {
            trials.add(claims.wrong, counts);
        }
    }
    let bits = all.first().map_or(0, |(mark, _)| mark.embedding.bits);
    let exact: Vec<f64> = (1..=POWERS as i32).map(|k| attainable(bits, 10_f64.powi(-k))).collect();
    let rows = exact.iter().enumerate().map(|(k, exact)| {
        Row::new(vec![
            Cell::text(format!("1e-{}", k + 1)),
            Cell::text(format!("{exact:.2e}")),
            as_given.cell(k),
            searched.cell(k),
            trials.cell(k),
        ])
    });
    report.tables.push(Table {
        title: format!(
            "Wrong claims: {} as given, {} searched, {} with views as trials",
            as_given.claims, searched.claims, trials.claims
        ),
        columns: [
            "p at most",
            "exactly",
            "as given: share",
            "all framings searched and counted: share",
            "WRONG, bits of two views as trials: share",
        ]
        .map(String::from)
        .to_vec(),
        rows: rows.collect(),
        notes: vec![WRONG.into(), AS_TRIALS.into()],
    });
    let axes = Axes {
        title: "wrong claims: are p-values what they say?",
        x: "k",
        y: "log10 of the share with p <= 10^-k",
    };
    let exact = exact.iter().enumerate().map(|(k, share)| Point {
        x: k as f64 + 1.0,
        y: share.log10(),
        interval: None,
    });
    let drawn = [
        Line {
            name: "exactly, by the signed-rank distribution".into(),
            points: exact.collect(),
            dots: false,
        },
        as_given.line(format!("as given, {} claims", as_given.claims)),
        searched.line(format!("all framings searched and counted, {} claims", searched.claims)),
        trials.line(format!("WRONG: bits of two views as trials, {} claims", trials.claims)),
    ];
    report.plots.push(Plot {
        caption: "Wrong claims: share with p at or below 10^-k".into(),
        svg: lines(axes, &drawn)?,
    });
    Ok(())
}

/// The largest probability, not above `rate`, that a random subset of the ranks 1 to `bits` has so large a sum or a larger
/// one; 0 if there is none. Computed here once more, apart from the code whose p-values are judged by it.
fn attainable(bits: u32, rate: f64) -> f64 {
    let mut sums = vec![1.0];
    for rank in 1..=bits as usize {
        let mut next = vec![0.0; sums.len() + rank];
        for (sum, probability) in sums.iter().enumerate() {
            next[sum] += probability / 2.0;
            next[sum + rank] += probability / 2.0;
        }
        sums = next;
    }
    let tails = sums.iter().rev().scan(0.0, |above, probability| {
        *above += probability;
        Some(*above)
    });
    tails.take_while(|tail| *tail <= rate).last().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::named::{Experiment, Options, report};
    use crate::report::record::Record;
    use crate::report::testing::{claims, mark, records};

    #[test]
    fn known_tails() {
        // Seven subsets of ten ranks have a sum of 51 or more, of 55: those without none, 1, 2, 3, 1 and 2, 4, or 1 and 3.
        assert_eq!(attainable(10, 7.5 / 1024.0), 7.0 / 1024.0);
        assert!(
            (9.7e-7..=1e-6).contains(&attainable(64, 1e-6)),
            "{}",
            attainable(64, 1e-6)
        );
        assert_eq!(attainable(4, 0.1), 1.0 / 16.0);
        assert_eq!(attainable(16, 1e-6), 0.0);
    }

    #[test]
    fn rates_are_means_over_marks_and_wrong_claims_are_counted_together() {
        let marks = [mark("lego", 64, "standard", 1), mark("ship", 64, "standard", 1)];
        let mut second = claims(&marks[1], "none", true);
        second.p_values = vec![1e-9];
        let mut clean = claims(&marks[0], UNMARKED, false);
        (clean.p_values, clean.payloads, clean.wrong_as_trials) = (Vec::new(), 0, None);
        let all = records([
            Record::Mark(marks[0].clone()),
            Record::Mark(marks[1].clone()),
            Record::Claims(claims(&marks[0], "none", true)),
            Record::Claims(second),
            Record::Claims(clean),
        ]);
        let selection = Selection::newest(&all).unwrap();
        let told = report(Experiment::Claims, &selection, &Options::default()).unwrap();
        let text = |table: usize, row: usize, cell: usize| told.tables[table].rows[row].cells[cell].to_string();
        assert_eq!(told.tables[0].rows.len(), 1);
        // Half of one mark's claims and all of the other's.
        assert!(text(0, 0, 6).starts_with("75.0"), "{}", text(0, 0, 6));
        assert_eq!(
            (text(0, 0, 3), text(0, 0, 5), text(0, 0, 8)),
            ("144".into(), "3".into(), "1.0e-9".into())
        );
        assert!(text(1, 0, 2).starts_with("1.00e-1 "), "{}", text(1, 0, 2));
        assert!(text(1, 1, 4).starts_with("6.00e-2 "), "{}", text(1, 1, 4));
        assert!(told.plots[0].svg.contains("WRONG"));
        let none = records([Record::Mark(marks[0].clone())]);
        let empty = report(
            Experiment::Claims,
            &Selection::newest(&none).unwrap(),
            &Options::default(),
        )
        .unwrap();
        assert_eq!(empty.missing, ["claims: not measured"]);
    }
}
