//! Rows of a file that are left out since a value of theirs is not legal: which they are, and what becomes of them.
use crate::gaussians::{Gaussians, Sh};
use std::fmt;

/// What becomes of rows with a value that is not legal, NaN above all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BadRows {
    /// The scene is refused, with property, row and value.
    #[default]
    Refuse,
    /// They are left out of the Gaussians and counted. A written file has them as they were, byte by byte.
    Ignore,
}

impl BadRows {
    /// They are ignored where that was asked for.
    pub fn ignored_if(asked: bool) -> BadRows {
        if asked { BadRows::Ignore } else { BadRows::Refuse }
    }
}

/// Rows of a file that are no Gaussians of its scene; displayed, how many and what is wrong with the first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ignored {
    /// Ascending.
    rows: Vec<usize>,
    /// What is wrong with the first.
    first: String,
}

impl Ignored {
    /// How many.
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// These, where there are some.
    pub(crate) fn if_any(&self) -> Option<&Ignored> {
        Some(self).filter(|ignored| !ignored.rows.is_empty())
    }

    /// What is wrong with the first: property, row and value.
    pub fn first(&self) -> &str {
        &self.first
    }

    /// Adds rows of a part of a scene, which messages call `part` and whose rows are from `first` on.
    pub(crate) fn append(&mut self, other: &Ignored, first: usize, part: &str) {
        if self.rows.is_empty() {
            self.first = format!("{part}: {}", other.first);
        }
        self.rows.extend(other.rows.iter().map(|row| first + row));
    }

    /// The row in the file of Gaussian `row` of the scene.
    pub(crate) fn file_row(&self, row: usize) -> usize {
        // Bad row `i`, of which `i` are before, comes before all Gaussians from `rows[i] - i` on.
        let (mut low, mut high) = (0, self.rows.len());
        while low < high {
            let middle = low.midpoint(high);
            if self.rows[middle] - middle <= row {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        row + low
    }

    /// The colours of `sh` for the rows of the file in their order, `None` for those that stay as they are.
    pub(crate) fn spread<'a>(&'a self, sh: &'a Sh) -> impl Iterator<Item = Option<&'a [f32]>> {
        let mut bad = self.rows.iter().peekable();
        let mut colours = sh.coefficients.chunks_exact(sh.per_gaussian());
        (0..).map_while(move |row| match bad.next_if_eq(&&row) {
            Some(_) => Some(None),
            None => colours.next().map(Some),
        })
    }

    /// Takes the rows out of Gaussians that have all of the file's.
    pub(crate) fn take_from(&self, gaussians: &mut Gaussians) {
        if self.rows.is_empty() {
            return;
        }
        let colour = gaussians.sh.per_gaussian();
        self.take_out(&mut gaussians.positions, 1);
        self.take_out(&mut gaussians.rotations, 1);
        self.take_out(&mut gaussians.log_scales, 1);
        self.take_out(&mut gaussians.opacity_logits, 1);
        self.take_out(&mut gaussians.sh.coefficients, colour);
        gaussians.sh.trim();
    }

    fn take_out<T: Copy>(&self, values: &mut Vec<T>, each: usize) {
        let mut kept = 0;
        let mut bad = self.rows.iter().peekable();
        for row in 0..values.len() / each {
            if bad.next_if_eq(&&row).is_none() {
                values.copy_within(row * each..(row + 1) * each, kept);
                kept += each;
            }
        }
        values.truncate(kept);
    }
}

impl fmt::Display for Ignored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.count() {
            0 => f.write_str("no row ignored"),
            1 => write!(f, "1 row ignored: {}", self.first),
            count => write!(f, "{count} rows ignored, the first since {}", self.first),
        }
    }
}

/// Sorts out rows while a file is read.
#[derive(Debug, Default)]
pub(crate) struct RowFilter {
    bad_rows: BadRows,
    ignored: Ignored,
    /// The first of them.
    least: Option<usize>,
}

impl RowFilter {
    /// That does with bad rows as it is told.
    pub fn new(bad_rows: BadRows) -> RowFilter {
        RowFilter {
            bad_rows,
            ..RowFilter::default()
        }
    }

    /// Sorts out a row, any number of times and in any order; `Err` is the reason where bad rows are refused.
    pub fn reject(&mut self, row: usize, reason: impl FnOnce() -> String) -> Result<(), String> {
        if self.bad_rows == BadRows::Refuse {
            return Err(reason());
        }
        if self.least.is_none_or(|least| row < least) {
            self.least = Some(row);
            self.ignored.first = reason();
        }
        self.ignored.rows.push(row);
        Ok(())
    }

    /// The rows that were sorted out.
    pub fn finish(self) -> Ignored {
        let mut ignored = self.ignored;
        ignored.rows.sort_unstable();
        ignored.rows.dedup();
        ignored.rows.shrink_to_fit();
        ignored
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Gaussians without the rows `bad`.
    pub(crate) fn without(all: &Gaussians, bad: &BTreeSet<usize>) -> Gaussians {
        let good = || (0..all.len()).filter(|row| !bad.contains(row));
        let colour = all.sh.per_gaussian();
        let mut sh = Sh {
            degree: all.sh.degree,
            coefficients: good()
                .flat_map(|row| all.sh.coefficients[row * colour..(row + 1) * colour].to_vec())
                .collect(),
        };
        sh.trim();
        Gaussians {
            positions: good().map(|row| all.positions[row]).collect(),
            rotations: good().map(|row| all.rotations[row]).collect(),
            log_scales: good().map(|row| all.log_scales[row]).collect(),
            opacity_logits: good().map(|row| all.opacity_logits[row]).collect(),
            sh,
        }
    }

    fn of(rows: impl IntoIterator<Item = usize>) -> Ignored {
        let mut sieve = RowFilter::new(BadRows::Ignore);
        for row in rows {
            sieve.reject(row, || format!("row {row}")).unwrap();
        }
        sieve.finish()
    }

    #[test]
    fn the_first_row_is_told_whenever_it_was_found() {
        let ignored = of([7, 3, 9, 3]);
        assert_eq!((ignored.count(), ignored.first()), (3, "row 3"));
        assert_eq!(ignored.to_string(), "3 rows ignored, the first since row 3");
        assert_eq!(of([5]).to_string(), "1 row ignored: row 5");
        assert_eq!(of([]).if_any(), None);
        let mut sieve = RowFilter::new(BadRows::default());
        assert_eq!(sieve.reject(4, || "why".into()), Err("why".into()));
        assert_eq!(sieve.finish(), Ignored::default());
    }

    proptest! {
        #[test]
        fn rows_of_scene_and_file_are_the_same(rows in 0..40usize, bad in prop::collection::btree_set(0..40usize, 0..40)) {
            let bad: BTreeSet<usize> = bad.into_iter().filter(|row| *row < rows).collect();
            let ignored = of(bad.iter().rev().copied());
            let good: Vec<usize> = (0..rows).filter(|row| !bad.contains(row)).collect();
            let found: Vec<usize> = (0..good.len()).map(|row| ignored.file_row(row)).collect();
            prop_assert_eq!(&found, &good);
            // Every colour is the number of its row.
            let all = Gaussians {
                positions: (0..rows).map(|row| [row as f32; 3]).collect(),
                rotations: vec![[1.0; 4]; rows],
                log_scales: vec![[0.0; 3]; rows],
                opacity_logits: (0..rows).map(|row| row as f32).collect(),
                sh: Sh { degree: 0, coefficients: (0..3 * rows).map(|i| (i / 3) as f32).collect() },
            };
            let mut kept = all.clone();
            ignored.take_from(&mut kept);
            prop_assert_eq!(&kept, &without(&all, &bad));
            let spread: Vec<Option<f32>> = ignored.spread(&kept.sh).map(|colour| Some(colour?[2])).collect();
            let expected: Vec<Option<f32>> = (0..rows).map(|row| (!bad.contains(&row)).then_some(row as f32)).collect();
            prop_assert_eq!(spread, expected);
        }
    }
}
