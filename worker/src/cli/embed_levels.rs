//! `embed` of a SOG that is streamed in levels of detail.
use std::time::{Duration, Instant};

use guardsplat_engine::embed::{Job, Outcome};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::scene::StreamedSog;
use guardsplat_engine::{Error, Result};
use serde::Serialize;

use super::display::Display;
use super::embed::{Arguments, line, show, tell_missed, write_report};
use super::{Exit, print_json, print_line};
use guardsplat_operations::embed_levels::{Event, embed_levels};
use guardsplat_operations::embed_report::EmbedReport;

/// The streamed SOG that is to be marked, if it is one. It is many files, which credentials are not of.
pub fn open(arguments: &Arguments) -> Result<Option<StreamedSog>> {
    let streamed = StreamedSog::open(&arguments.input)?;
    if streamed.is_some() && arguments.signing.is_wanted() {
        return Err(Error::BadOption {
            field: "--credentials",
            reason: "they are of one file, and a SOG with a lod-meta.json is many".into(),
        });
    }
    Ok(streamed)
}

#[derive(Serialize)]
struct Report<'a> {
    levels: Vec<LevelReport<'a>>,
    written: bool,
}

#[derive(Serialize)]
struct LevelReport<'a> {
    level: usize,
    #[serde(flatten)]
    report: EmbedReport<'a>,
}

/// Marks all levels and tells of each.
pub fn run(arguments: &Arguments, engine: &Engine, key: &Key, job: &Job<'_>, streamed: &StreamedSog) -> Result<Exit> {
    let (mut display, mut verifying) = (Display::new("embedding"), None);
    let (mut start, mut durations) = (Instant::now(), Vec::new());
    let levels = embed_levels(engine, job, streamed, &mut |level, event| {
        match event {
            Event::Begun(gaussians) => {
                start = Instant::now();
                display = Display::new("embedding");
                display.say(&format!("level {level}: {gaussians} Gaussians"));
            }
            Event::Progress(progress) => show(&mut display, &mut verifying, progress),
            Event::Done(outcome) => {
                display.finish();
                verifying = None;
                durations.push(start.elapsed());
                if let Some(folder) = &arguments.report {
                    write_report(&folder.join(format!("level-{level}")), &outcome.verification)?;
                }
                if !arguments.json {
                    let report = EmbedReport::of(outcome, engine, key, arguments.preset, start.elapsed());
                    print_line(&format!("level {level}: {}", line(&report)));
                }
                tell_missed(&format!("level {level}"), outcome);
            }
        }
        Ok(())
    })?;
    if arguments.json {
        let told = levels.outcomes.iter().zip(&durations);
        print_json(&Report {
            levels: told
                .map(
                    |((level, outcome), duration): (&(usize, Outcome), &Duration)| LevelReport {
                        level: *level,
                        report: EmbedReport::of(outcome, engine, key, arguments.preset, *duration),
                    },
                )
                .collect(),
            written: levels.written,
        })?;
    } else if levels.written {
        print_line(&format!("written to {}", arguments.output.display()));
    }
    if !levels.written {
        eprintln!("nothing was written: every level has to carry the mark");
    }
    let missed = levels.outcomes.iter().any(|(_, outcome)| !outcome.missed.is_empty());
    Ok(if missed { Exit::Inconclusive } else { Exit::Done })
}
