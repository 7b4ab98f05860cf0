//! `models list`, `models add`, `models verify`.
use clap::Subcommand;
use guardsplat_worker::Result;
use guardsplat_worker::models::{Entry, LPIPS, Models};

use super::{Exit, print_json, print_line};

#[derive(Subcommand)]
pub enum Command {
    /// Lists the models that were added
    List {
        /// Prints JSON on standard output
        #[arg(long)]
        json: bool,
    },
    /// Adds a CLIP, or LPIPS under the name lpips-alex
    Add {
        /// What to call it
        name: String,
        /// A safetensors file, a folder with one, or its https URL; a CLIP's configuration is taken from beside it
        #[arg(value_name = "FILE|DIR|URL")]
        source: String,
        /// SHA-256 of the weights, in hexadecimal
        #[arg(long, value_name = "HEX")]
        sha256: String,
    },
    /// Hashes models again and compares
    Verify {
        /// Which one; all unless given
        name: Option<String>,
    },
}

pub fn run(command: Command) -> Result<Exit> {
    let models = Models::open()?;
    match command {
        Command::List { json: true } => print_json(&models.list()?)?,
        Command::List { json: false } => {
            let entries = models.list()?;
            entries.iter().for_each(|entry| print_line(&line(entry)));
            if entries.is_empty() {
                print_line("none were added; the shipped CLIP needs no adding");
            }
        }
        Command::Add {
            name,
            source,
            sha256,
        } => print_line(&format!(
            "added {}",
            line(&models.add(&name, &source, &sha256)?)
        )),
        Command::Verify { name: Some(name) } => {
            print_line(&format!("intact: {}", line(&models.verify(&name)?)));
        }
        Command::Verify { name: None } => {
            for entry in models.list()? {
                print_line(&format!("intact: {}", line(&models.verify(&entry.name)?)));
            }
        }
    }
    Ok(Exit::Done)
}

fn line(entry: &Entry) -> String {
    let kind = if entry.name == LPIPS { "LPIPS" } else { "CLIP" };
    let bytes: u64 = entry.files.values().map(|file| file.bytes).sum();
    format!(
        "{} ({kind}, {:.1} MB) from {}",
        entry.name,
        bytes as f64 / 1e6,
        entry.source
    )
}
