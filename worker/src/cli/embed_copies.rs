//! `embed --messages`: a copy of the scene for each of some messages.
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use guardsplat_codeword::Message;
use guardsplat_engine::embed::{Job, Outcome, Progress, Step, embed_together};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::{Error, Result};
use serde::Serialize;

use super::display::Display;
use super::embed::{Arguments, line, tell_missed, write_report};
use super::{Exit, print_json, print_line};
use guardsplat_operations::embed_report::EmbedReport;

/// A message with the file that is to carry it.
pub struct Copy {
    pub message: Message,
    output: PathBuf,
}

#[derive(Serialize)]
struct Report<'a> {
    copies: Vec<CopyReport<'a>>,
}

#[derive(Serialize)]
struct CopyReport<'a> {
    output: &'a Path,
    #[serde(flatten)]
    report: EmbedReport<'a>,
}

/// The copies that a file asks for: a message of `bits` a line, each in a file of `folder` that has the message's name.
///
/// # Errors
/// A file that cannot be read or has no message, a line that is not such a message, a message that was there before.
pub fn read(file: &Path, bits: usize, input: &Path, folder: &Path) -> Result<Vec<Copy>> {
    let bad = |reason: String| Error::BadOption {
        field: "--messages",
        reason: format!("{}: {reason}", file.display()),
    };
    let text = std::fs::read_to_string(file).map_err(Error::io(file))?;
    let extension = input.extension().unwrap_or_default();
    let (mut copies, mut lines) = (Vec::new(), HashMap::new());
    let filled = text
        .lines()
        .map(str::trim)
        .enumerate()
        .filter(|(_, text)| !text.is_empty());
    for (line, text) in filled.map(|(place, text)| (place + 1, text)) {
        let message = Message::parse(text, bits).map_err(|e| bad(format!("line {line}: {e}")))?;
        let name = message.to_string();
        if let Some(before) = lines.insert(name.clone(), line) {
            return Err(bad(format!("line {line}: the message of line {before} again")));
        }
        let output = folder.join(name).with_extension(extension);
        copies.push(Copy { message, output });
    }
    if copies.is_empty() {
        return Err(bad("no message".into()));
    }
    Ok(copies)
}

/// Marks all copies, so many together, and tells of each.
pub fn run(arguments: &Arguments, engine: &Engine, key: &Key, job: &Job<'_>, copies: &[Copy]) -> Result<Exit> {
    let folder = job.output;
    std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let mut told: Vec<(Outcome, f64)> = Vec::with_capacity(copies.len());
    for copies in copies.chunks(arguments.together.into()) {
        let start = Instant::now();
        let jobs: Vec<Job<'_>> = copies
            .iter()
            .map(|copy| Job {
                message: &copy.message,
                output: &copy.output,
                ..*job
            })
            .collect();
        let mut watched = Watched::new(copies);
        let outcomes = embed_together(engine, &jobs, &mut |place, event| watched.show(place, event))?;
        watched.display.finish();
        // Each has its share of the time.
        let seconds = start.elapsed().as_secs_f64() / copies.len() as f64;
        for (copy, mut outcome) in copies.iter().zip(outcomes) {
            if let Some(folder) = &arguments.report {
                write_report(&folder.join(copy.message.to_string()), &outcome.verification)?;
            }
            // A file may ask for more copies than memory has room for the pictures of.
            outcome.verification.pairs = Vec::new();
            told.push((outcome, seconds));
        }
    }
    let copies = told.iter().zip(copies).map(|((outcome, seconds), copy)| {
        let duration = std::time::Duration::from_secs_f64(*seconds);
        CopyReport {
            output: &copy.output,
            report: EmbedReport::of(outcome, engine, key, arguments.preset, duration),
        }
    });
    let report = Report {
        copies: copies.collect(),
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        for copy in &report.copies {
            let where_to = if copy.report.written { "" } else { "not " };
            print_line(&format!(
                "{} {where_to}written: {}",
                copy.output.display(),
                line(&copy.report)
            ));
        }
    }
    for ((outcome, _), copy) in told.iter().zip(&report.copies) {
        tell_missed(&copy.output.display().to_string(), outcome);
    }
    Ok(match told.iter().all(|(outcome, _)| outcome.missed.is_empty()) {
        true => Exit::Done,
        false => Exit::Inconclusive,
    })
}

/// Shows how copies get on that are made together.
struct Watched<'a> {
    copies: &'a [Copy],
    display: Display,
    verifying: bool,
    /// The last step of each.
    steps: Vec<Option<Step>>,
}

impl<'a> Watched<'a> {
    fn new(copies: &'a [Copy]) -> Self {
        Self {
            copies,
            display: Display::new("embedding"),
            verifying: false,
            steps: vec![None; copies.len()],
        }
    }

    fn show(&mut self, place: usize, progress: Progress) {
        let message = &self.copies[place].message;
        match progress {
            Progress::Step(step) => {
                self.steps[place] = Some(step);
                self.show_steps();
            }
            Progress::Admitted(memory) if place == 0 => self.display.say(&format!("memory: {memory}")),
            Progress::Check(check) => self.display.say(&format!(
                "{message}, step {}: held-out bits {:.1} %, PSNR {:.2} dB",
                check.step,
                100.0 * check.bit_accuracy,
                check.psnr_db
            )),
            Progress::Stopped { step } => self.display.say(&format!("{message}: enough after {step} steps")),
            Progress::Writing if !self.verifying => {
                self.display.finish();
                self.display = Display::new("verifying");
                self.verifying = true;
            }
            Progress::Verifying { done, total } => {
                let all = total * self.copies.len();
                self.display.set(place * total + done, all, || message.to_string());
            }
            _ => {}
        }
    }

    /// The step that all are at, or were, and the mean figures.
    fn show_steps(&mut self) {
        let steps: Vec<&Step> = self.steps.iter().flatten().collect();
        let (Some(step), Some(total)) = (
            steps.iter().map(|step| step.step).max(),
            steps.iter().map(|step| step.total).max(),
        ) else {
            return;
        };
        let mean = |of: fn(&Step) -> f64| steps.iter().map(|step| of(step)).sum::<f64>() / steps.len() as f64;
        self.display.set(step, total, || {
            format!(
                "{} copies, bits {:.1} %, PSNR {:.1} dB",
                steps.len(),
                100.0 * mean(|step| step.bit_accuracy),
                mean(|step| step.psnr_db)
            )
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_line_by_line() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("messages");
        let read = |text: &str| {
            std::fs::write(&file, text).unwrap();
            read(&file, 8, Path::new("in.ply"), Path::new("marked"))
        };
        let copies = read("a1\n\n  0F \n").unwrap();
        let outputs: Vec<&Path> = copies.iter().map(|copy| copy.output.as_path()).collect();
        assert_eq!(outputs, [Path::new("marked/a1.ply"), Path::new("marked/0f.ply")]);
        for (text, reason) in [
            ("", "no message"),
            ("a1\nxyz", "line 2"),
            ("a1\n\nA1", "line 3: the message of line 1 again"),
        ] {
            let error = read(text).err().unwrap().to_string();
            assert!(error.contains("--messages") && error.contains(reason), "{error}");
        }
    }
}
