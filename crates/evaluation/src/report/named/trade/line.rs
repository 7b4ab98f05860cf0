//! Runs of a variant of the settings, summed up, and where they were timed.
use std::collections::{BTreeMap, BTreeSet};

use crate::report::names::{NONE, SHARED, TRADE};
use crate::report::record::{Mark, Timing};
use crate::report::selection::{Run, Selection};
use crate::report::summary::{Estimate, Summary};

/// What is timed together: one device of one machine, with as many threads, and messages of one length.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub bits: u32,
    pub device: String,
    pub machine: String,
}

/// Runs of a variant, summed up.
pub(super) struct Line<'a> {
    pub name: &'a str,
    pub bits: u32,
    pub runs: Vec<Run<'a>>,
    /// Of pictures as they are.
    pub summary: Summary,
    /// Bits of pictures that were shared, in percent: the mean over [`SHARED`], if marks were read under all of them.
    pub shared: Option<Estimate>,
    /// Whether all scenes and seeds of the place are among its runs.
    pub whole: bool,
}

impl Line<'_> {
    /// Mean seconds of an embedding.
    pub fn seconds(&self) -> Option<f64> {
        self.summary.seconds.map(|mean| mean.mean)
    }

    /// Mean PSNR in dB; of views that are all identical it is infinite.
    pub fn psnr(&self) -> Option<f64> {
        let psnr = &self.summary.psnr;
        match (psnr.differing, psnr.identical) {
            (Some(mean), _) => Some(mean.mean),
            (None, 1..) => Some(f64::INFINITY),
            (None, 0) => None,
        }
    }

    /// Share of marks whose whole message is right from so many views, in percent.
    pub fn success(&self, views: u32) -> Option<f64> {
        let share = self.summary.whole.get(&views)?;
        Some(100.0 * share.right as f64 / share.of.max(1) as f64)
    }
}

/// Lines by place, of each the fastest first.
pub(super) fn by_place<'a>(selection: &Selection<'a>) -> Vec<(Place, Vec<Line<'a>>)> {
    let mut places: BTreeMap<Place, BTreeMap<&str, Vec<Run<'_>>>> = BTreeMap::new();
    for run in selection.all_runs() {
        let embedding = &run.mark.embedding;
        let named = embedding
            .variant
            .strip_prefix(TRADE)
            .and_then(|rest| rest.split_once(':'));
        let Some((_, variant)) = named.filter(|_| run.reading.attack == NONE) else {
            continue;
        };
        let place = Place {
            bits: embedding.bits,
            device: run.mark.device.clone(),
            machine: run.mark.timing.as_ref().map_or("an unknown machine".into(), machine),
        };
        places.entry(place).or_default().entry(variant).or_default().push(run);
    }
    let told = places.into_iter();
    told.map(|(place, variants)| (place, lines(selection, variants)))
        .collect()
}

fn machine(timing: &Timing) -> String {
    let s = |count: u32| if count == 1 { "" } else { "s" };
    let (threads, cores) = (timing.threads, timing.cores);
    format!(
        "{}, {threads} thread{} on {cores} core{}",
        timing.processor,
        s(threads),
        s(cores)
    )
}

fn lines<'a>(selection: &Selection<'a>, variants: BTreeMap<&'a str, Vec<Run<'a>>>) -> Vec<Line<'a>> {
    let of_run = |run: &Run<'a>| (run.mark.embedding.scene.as_str(), run.mark.embedding.seed);
    let all: BTreeSet<(&str, u64)> = variants.values().flatten().map(of_run).collect();
    let line = |(name, runs): (&'a str, Vec<Run<'a>>)| Line {
        name,
        bits: runs.first().map_or(0, |run| run.mark.embedding.bits),
        summary: Summary::of(&runs),
        shared: shared(selection, &runs),
        whole: runs.iter().map(of_run).collect::<BTreeSet<_>>() == all,
        runs,
    };
    let mut lines: Vec<Line<'_>> = variants.into_iter().map(line).collect();
    lines.sort_by(|a, b| {
        let order = |line: &Line<'_>| line.seconds().unwrap_or(f64::INFINITY);
        order(a).total_cmp(&order(b)).then(a.name.cmp(b.name))
    });
    lines
}

/// Mean over marks of what is read of their shared pictures; none where a mark was not read under all that is done.
fn shared(selection: &Selection<'_>, runs: &[Run<'_>]) -> Option<Estimate> {
    let of_mark = |mark: &Mark| -> Option<f64> {
        let (bits, variant) = (mark.embedding.bits, mark.embedding.variant.as_str());
        let under = |attack: &str| {
            let all = selection.runs(bits, variant, attack).into_iter();
            let run = all.into_iter().find(|run| run.mark.embedding == mark.embedding)?;
            Some(100.0 * run.reading.accuracy())
        };
        let read: Vec<f64> = SHARED.iter().map(|attack| under(attack)).collect::<Option<_>>()?;
        Some(read.iter().sum::<f64>() / SHARED.len() as f64)
    };
    let read: Vec<f64> = runs.iter().map(|run| of_mark(run.mark)).collect::<Option<_>>()?;
    Estimate::of(&read)
}
