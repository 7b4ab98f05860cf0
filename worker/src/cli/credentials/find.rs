//! `credentials find`: soft binding resolution without a server.
use std::path::{Path, PathBuf};

use clap::Args;
use guardsplat_codeword::{Message, Verdict};
use guardsplat_engine::message::Key;
use guardsplat_operations::search::{Nearest, read_and_search};
use guardsplat_operations::suspect::Suspect;
use guardsplat_soft_binding::Value;
use serde::Serialize;

use super::{Exit, copy};
use crate::cli::display::Display;
use crate::cli::{print_json, print_line};
use crate::credentials_program::{Named, binding_key, marks};
use crate::error::{Error, Result};

#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    copy: copy::Arguments,
    /// The folder with credentials (.c2pa)
    #[arg(long, value_name = "FOLDER")]
    store: PathBuf,
}

/// A message that credentials name.
struct Candidate {
    path: PathBuf,
    manifest: Option<String>,
    message: Message,
}

/// What is told.
#[derive(Serialize)]
struct Report<'a> {
    verdict: Verdict,
    /// The credentials; null unless they are found.
    credentials: Option<&'a Path>,
    manifest: Option<&'a str>,
    p_value: Option<f64>,
    threshold: Option<f64>,
    matched_bits: Option<u32>,
    bits: usize,
    /// Different messages of this key in the store, each of which the p-value pays for.
    compared: usize,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let suspect = arguments.copy.suspect()?;
    let key = arguments.copy.key()?;
    let candidates = candidates(&arguments.store, &key)?;
    let messages: Vec<Message> = candidates.iter().map(|candidate| candidate.message).collect();
    let nearest = if messages.is_empty() {
        None
    } else {
        search(&arguments.copy, &key, &suspect, &messages)?
    };
    let decision = nearest.as_ref().map(|nearest| &nearest.comparison.decision);
    let verdict = decision.map_or(Verdict::NoMatch, |decision| decision.verdict);
    let found = nearest
        .as_ref()
        .filter(|_| verdict == Verdict::Match)
        .and_then(|nearest| candidates.get(nearest.index));
    let report = Report {
        verdict,
        credentials: found.map(|found| found.path.as_path()),
        manifest: found.and_then(|found| found.manifest.as_deref()),
        p_value: decision.map(|decision| decision.p_value),
        threshold: decision.map(|decision| decision.threshold),
        matched_bits: decision.map(|decision| decision.matched_bits),
        bits: key.bits(),
        compared: candidates.len(),
    };
    if arguments.copy.json {
        print_json(&report)?;
    } else {
        tell(&report);
    }
    Ok(match verdict {
        Verdict::Match => Exit::Done,
        Verdict::NoMatch => Exit::NoMatch,
        Verdict::Inconclusive | Verdict::UnknownKey => Exit::Inconclusive,
    })
}

/// Messages of this key that credentials in the folder name, each once: of several files the first by name.
fn candidates(store: &Path, key: &Key) -> Result<Vec<Candidate>> {
    let entries = std::fs::read_dir(store).map_err(Error::io(store))?;
    let mut paths: Vec<PathBuf> = entries
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<std::io::Result<_>>()
        .map_err(Error::io(store))?;
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "c2pa"));
    paths.sort();
    let id = key.id();
    let mut candidates: Vec<Candidate> = Vec::new();
    for Named {
        path,
        manifest,
        intact,
        marks: values,
        reason,
    } in marks(&paths)?
    {
        if !intact {
            let reason = reason.unwrap_or_else(|| "changed since it was signed".into());
            eprintln!("left out: {}: {reason}", path.display());
            continue;
        }
        let values = values.iter().filter_map(|text| Value::parse(text).ok());
        for message in values.filter_map(|value| value.open(binding_key(key, &id), key.bits())) {
            if candidates.iter().all(|known| known.message != message) {
                candidates.push(Candidate {
                    path: path.clone(),
                    manifest: manifest.clone(),
                    message,
                });
            }
        }
    }
    Ok(candidates)
}

fn search(copy: &copy::Arguments, key: &Key, suspect: &Suspect, messages: &[Message]) -> Result<Option<Nearest>> {
    let engine = copy.engine(key)?;
    let mut display = Display::new("reading");
    Ok(read_and_search(
        &engine,
        suspect,
        &copy.views()?,
        messages,
        |done, total| {
            display.set(done, total, String::new);
        },
    )?)
}

fn tell(report: &Report<'_>) {
    let agreed = match (report.matched_bits, report.p_value) {
        (Some(matched), Some(p_value)) => format!(
            "{matched} of {} bits, p = {p_value:.2e} (threshold {:e})",
            report.bits,
            report.threshold.unwrap_or_default()
        ),
        _ => "no credentials there name this key".into(),
    };
    print_line(&match report.credentials {
        Some(path) => format!("found: {}: {agreed}", path.display()),
        None => format!("not found: {agreed}"),
    });
    if report.compared > 1 {
        print_line(&format!(
            "nearest of {} messages that credentials there name",
            report.compared
        ));
    }
}
