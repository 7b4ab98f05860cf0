//! What a reader of a table of times must know: what is judged, and whether the seconds can be compared.
use std::collections::BTreeSet;

use super::Reads;
use super::line::Line;
use crate::report::names::SHARED;
use crate::report::record::Timing;

/// Load before a run, per core, up to which a machine is called quiet.
const QUIET: f64 = 0.15;

/// What the front is of, and whether the seconds can be compared.
pub(super) fn of(lines: &[Line<'_>], reads: Reads) -> Vec<String> {
    let mut notes = vec![match reads {
        Reads::Shared => format!("Shared pictures: the mean over {}.", SHARED.join(", ")),
        Reads::Whole(views) => {
            let s = if views == 1 { "" } else { "s" };
            format!("What is read are whole messages from {views} view{s} there.")
        }
    }];
    let partial = lines.iter().filter(|line| !line.whole).count();
    if partial > 0 {
        notes.push(format!(
            "{partial} variants lack scenes or seeds that others have, and are not compared."
        ));
    }
    let runs = || lines.iter().flat_map(|line| &line.runs);
    let timings: Vec<&Timing> = runs().filter_map(|run| run.mark.timing.as_ref()).collect();
    if timings.len() < runs().count() {
        notes.push("Of some marks it was not kept where and when they were timed: seconds cannot be compared.".into());
    }
    let began: BTreeSet<&str> = timings.iter().map(|timing| timing.began.as_str()).collect();
    if let (Some(first), Some(last)) = (began.first(), began.last()) {
        notes.push(format!("Timed from {first} to {last}."));
    }
    let programs: BTreeSet<&str> = timings.iter().map(|timing| timing.run.as_str()).collect();
    if programs.len() > 1 {
        let count = programs.len();
        notes.push(format!(
            "The seconds are of {count} runs of the program: what else the machine did may have differed. Only \
             seconds of one run on a quiet machine can be compared."
        ));
    }
    notes.push(quiet(&timings));
    notes
}

/// Whether the machine had nothing else to do.
fn quiet(timings: &[&Timing]) -> String {
    let load = |timing: &&Timing| Some((timing.load_before?, timing.cores.max(1)));
    let share = |(load, cores): &(f64, u32)| load / f64::from(*cores);
    let most = timings.iter().filter_map(load);
    match most.max_by(|a, b| share(a).total_cmp(&share(b))) {
        None => "It is not known whether the machine was quiet.".into(),
        Some(load) if share(&load) <= QUIET => "The machine was quiet before the run began.".into(),
        Some((load, cores)) => format!(
            "The machine was not quiet: in the minute before the run its load was {load:.1}, with {cores} cores. Seconds \
             here cannot be compared with those of anywhere else, and not well with each other; processor seconds are \
             less affected."
        ),
    }
}
