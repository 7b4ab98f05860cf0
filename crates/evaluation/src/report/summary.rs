//! What some runs have in common: means over runs with their intervals.
use super::interval;
use super::record::Mark;
use super::selection::Run;
use std::collections::{BTreeMap, BTreeSet};

/// A mean over runs; one run is one mark, however many views it was read from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// 95 % interval by Student's t, from two runs on.
    pub interval: Option<[f64; 2]>,
    /// Runs.
    pub runs: usize,
}

impl Estimate {
    /// Of some values; `None` without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let (mean, interval) = interval::mean(values)?;
        let runs = values.len();
        Some(Self { mean, interval, runs })
    }

    /// The same with limits that the quantity has; intervals by t know of none.
    fn within(mut self, low: f64, high: f64) -> Self {
        self.interval = self.interval.map(|interval| interval.map(|end| end.clamp(low, high)));
        self
    }
}

/// How many of some runs succeeded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share {
    /// Runs that did.
    pub right: usize,
    /// Runs.
    pub of: usize,
    /// Wilson's 95 % interval, 0..=1.
    pub interval: [f64; 2],
}

/// Mean PSNR, of which identical views have none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Psnr {
    /// Over the runs whose views differ, in dB, if there are any.
    pub differing: Option<Estimate>,
    /// Runs whose views are identical.
    pub identical: usize,
}

/// Some runs, summed up.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Runs.
    pub runs: usize,
    /// Bit accuracy in percent, 0..=100.
    pub accuracy: Option<Estimate>,
    /// Whether the whole message was right, by the number of views it was read from.
    pub whole: BTreeMap<u32, Share>,
    /// PSNR of marked against unmarked views.
    pub psnr: Psnr,
    /// Their SSIM, -1..=1.
    pub ssim: Option<Estimate>,
    /// Their LPIPS, over the runs that it was measured in.
    pub lpips: Option<Estimate>,
    /// Seconds of an embedding.
    pub seconds: Option<Estimate>,
    /// PSNR of attacked against unattacked views in dB, over the runs that it was measured in.
    pub attacked_psnr: Option<Estimate>,
}

impl Summary {
    /// Of marks that nothing was read of.
    pub fn of_marks(marks: &[&Mark]) -> Self {
        let all = |value: &dyn Fn(&Mark) -> Option<f64>| {
            let values: Vec<f64> = marks.iter().filter_map(|mark| value(mark)).collect();
            Estimate::of(&values)
        };
        Self {
            runs: marks.len(),
            accuracy: None,
            whole: BTreeMap::new(),
            psnr: Psnr {
                differing: all(&|mark| mark.psnr_db),
                identical: marks.iter().filter(|mark| mark.psnr_db.is_none()).count(),
            },
            ssim: all(&|mark| Some(mark.ssim)).map(|mean| mean.within(-1.0, 1.0)),
            lpips: all(&|mark| mark.lpips).map(|mean| mean.within(0.0, f64::INFINITY)),
            seconds: all(&|mark| Some(mark.seconds)).map(|mean| mean.within(0.0, f64::INFINITY)),
            attacked_psnr: None,
        }
    }

    /// Of some runs.
    pub fn of(runs: &[Run<'_>]) -> Self {
        let all = |value: &dyn Fn(&Run<'_>) -> Option<f64>| {
            let values: Vec<f64> = runs.iter().filter_map(value).collect();
            Estimate::of(&values)
        };
        let numbers: BTreeSet<u32> = runs
            .iter()
            .flat_map(|run| run.reading.message_right_from.keys().copied())
            .collect();
        let whole = |views: u32| {
            let tries = runs.iter().filter_map(|run| run.reading.message_right_from.get(&views));
            let (right, of) = tries.fold((0, 0), |(right, of), success| (right + usize::from(*success), of + 1));
            let interval = interval::wilson(right, of);
            (views, Share { right, of, interval })
        };
        Self {
            accuracy: all(&|run| Some(100.0 * run.reading.accuracy())).map(|mean| mean.within(0.0, 100.0)),
            whole: numbers.into_iter().map(whole).collect(),
            attacked_psnr: all(&|run| run.reading.psnr_db),
            ..Self::of_marks(&runs.iter().map(|run| run.mark).collect::<Vec<_>>())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{mark, reading};

    #[test]
    fn a_hand_computed_summary() {
        let mut marks = [
            mark("lego", 16, "standard", 1),
            mark("ship", 16, "standard", 1),
            mark("drums", 16, "standard", 1),
        ];
        marks[0].psnr_db = Some(38.0);
        marks[1].psnr_db = None;
        marks[2].psnr_db = Some(42.0);
        marks[0].seconds = 30.0;
        marks[2].lpips = None;
        // Accuracies 100, 75 and 50 %, however many views each has.
        let readings = [
            reading(&marks[0], "none", &[16, 16, 16, 16]),
            reading(&marks[1], "none", &[16, 8]),
            reading(&marks[2], "none", &[8]),
        ];
        let runs: Vec<Run<'_>> = marks
            .iter()
            .zip(&readings)
            .map(|(mark, reading)| Run { mark, reading })
            .collect();
        let summary = Summary::of(&runs);
        assert_eq!(summary.runs, 3);
        let accuracy = summary.accuracy.unwrap();
        assert_eq!(accuracy.mean, 75.0);
        // Deviation 25, error 14.4338, times 4.302653 is 62.10: beyond both limits.
        let [low, high] = accuracy.interval.unwrap();
        assert!((low - 12.896).abs() < 1e-3, "{low}");
        assert_eq!(high, 100.0);
        // Two of three are right from one view: Wilson 0.207660 to 0.938508.
        let whole = summary.whole[&1];
        assert_eq!((whole.right, whole.of), (2, 3));
        assert!((whole.interval[0] - 0.207_660).abs() < 1e-5 && (whole.interval[1] - 0.938_508).abs() < 1e-5);
        assert_eq!(summary.psnr.identical, 1);
        let psnr = summary.psnr.differing.unwrap();
        assert_eq!((psnr.mean, psnr.runs), (40.0, 2));
        assert_eq!(summary.seconds.unwrap().mean, 50.0);
        assert_eq!(summary.lpips.unwrap().runs, 2);
        assert_eq!(summary.attacked_psnr, None);
    }

    #[test]
    fn nothing_sums_up_to_nothing() {
        let summary = Summary::of(&[]);
        assert_eq!((summary.runs, summary.accuracy, summary.ssim), (0, None, None));
        assert!(summary.whole.is_empty());
    }
}
