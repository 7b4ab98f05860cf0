//! `key create`.
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, Subcommand};
use guardsplat_distortion::RobustTo;
use guardsplat_engine::clip::ShippedClip;
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::message::key::{HiddenKeyOptions, KeyProgress, create_hidden_key};
use guardsplat_engine::message::training::Progress;
use guardsplat_engine::message::{DecoderKind, Key, KeyOptions, TrainingOptions};
use guardsplat_engine::stop::Stop;
use guardsplat_engine::{Error, Result};
use serde::Serialize;

use super::display::Display;
use super::{Exit, Extractor, print_json, print_line};
use guardsplat_operations::{create_key, load};

#[derive(Subcommand)]
pub enum Command {
    /// Makes a key and trains its decoder
    Create(Create),
}

#[derive(Args)]
pub struct Create {
    /// Bits of its messages, 1 to 150
    #[arg(long)]
    bits: usize,
    /// Embeds messages of up to 16 bits as they are, instead of in words of 64 bits of which a fifth may be read wrong
    #[arg(long, hide_short_help = true)]
    uncoded: bool,
    /// Bits that one CLIP token stands for, 1 to 4; unless given the fewest that make room
    #[arg(long, hide_short_help = true)]
    bits_per_token: Option<usize>,
    /// Makes the key reproducible, and no more secret than this number; without it, it is drawn at random
    #[arg(long)]
    seed: Option<u64>,
    /// The key file
    #[arg(short, long)]
    output: PathBuf,
    /// What reads pictures: clip, or hidden for a convolutional decoder in the manner of HiDDeN, which is trained for the
    /// key and needs no CLIP
    #[arg(long, value_enum, default_value = "clip")]
    extractor: Extractor,
    /// Steps of the convolutional decoder's training
    #[arg(long, hide_short_help = true)]
    steps: Option<usize>,
    /// A CLIP by its name, shipped or added with `models add`, instead of the newest shipped one
    #[arg(long)]
    clip: Option<String>,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    /// Directions of strongest natural variation to ignore; unless given 64, at most an eighth of all
    #[arg(long, hide_short_help = true)]
    remove: Option<usize>,
    /// Dimensions to keep of the rest; all unless given
    #[arg(long, hide_short_help = true)]
    keep: Option<usize>,
    /// linear, or perceptron as in the GuardSplat paper; unless given what suits the CLIP, linear for the shipped one
    #[arg(long)]
    decoder: Option<DecoderKind>,
    /// Distortions of pictures that the key is to stand, as for `embed`: names with commas, all or none
    #[arg(long, value_name = "LIST", default_value = "none")]
    robust_to: RobustTo,
    /// Messages kept apart, on whose texts the decoder is measured
    #[arg(long, default_value_t = TrainingOptions::default().unseen)]
    unseen: usize,
    /// Noise in the decoder's training, times the natural variation
    #[arg(long, hide_short_help = true, default_value_t = TrainingOptions::default().noise)]
    noise: f32,
    /// Share of a perceptron's training that repeats the messages that are read worst, 0 to 1
    #[arg(long, hide_short_help = true, default_value_t = TrainingOptions::default().hard)]
    hard: f32,
    /// Prints JSON on standard output
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    key: String,
    bits: usize,
    word_bits: usize,
    bit_accuracy_unseen: Option<f64>,
    bit_accuracy_unseen_noisy: Option<f64>,
    clip: &'a str,
    device: &'a str,
    seconds: f64,
}

pub fn run(command: Command) -> Result<Exit> {
    let Command::Create(arguments) = command;
    let start = Instant::now();
    let clip = arguments.clip.as_deref();
    let compute = match arguments.extractor {
        Extractor::Clip => load::device(
            arguments.device,
            clip.unwrap_or(ShippedClip::NEWEST),
            load::Work::Reading,
        )?,
        Extractor::Hidden => open(arguments.device)?,
    };
    let key = match arguments.extractor {
        Extractor::Clip => for_clip(&arguments, &compute)?,
        Extractor::Hidden => hidden(&arguments, &compute)?,
    };
    key.write(&arguments.output)?;
    tell(&arguments, &compute, &key, start)?;
    Ok(Exit::Done)
}

/// A key whose messages are read from CLIP's features.
fn for_clip(arguments: &Create, compute: &Compute) -> Result<Key> {
    if arguments.steps.is_some() {
        return Err(Error::BadOption {
            field: "steps",
            reason: "they are of the convolutional decoder, --extractor hidden".into(),
        });
    }
    let kept = create_key::ProjectionOverrides {
        remove: arguments.remove,
        keep: arguments.keep,
        decoder: arguments.decoder,
    };
    let options = KeyOptions {
        bits: arguments.bits,
        coded: !arguments.uncoded,
        bits_per_token: arguments.bits_per_token,
        seed: arguments.seed,
        robust_to: arguments.robust_to,
        training: TrainingOptions {
            unseen: arguments.unseen,
            noise: arguments.noise,
            hard: arguments.hard,
            ..TrainingOptions::default()
        },
    };
    let mut display = Display::new("pictures");
    let mut stage = 0;
    let mut show = |number: usize, title: &'static str, done: usize, total: usize| {
        if stage != number {
            stage = number;
            display = Display::new(title);
        }
        display.set(done, total, String::new);
    };
    let clip = arguments.clip.as_deref();
    create_key::create(
        &options,
        kept,
        clip,
        compute,
        &Stop::default(),
        |progress| match progress {
            KeyProgress::Pictures(done, total) => show(0, "pictures", done, total),
            KeyProgress::Decoder(Progress::Encoding(done, total)) => show(1, "messages", done, total),
            KeyProgress::Decoder(Progress::Training(done, total)) => show(2, "decoder", done, total),
        },
    )
}

/// A key whose messages a convolutional decoder reads.
fn hidden(arguments: &Create, compute: &Compute) -> Result<Key> {
    let of_clip = [
        ("clip", arguments.clip.is_some()),
        ("decoder", arguments.decoder.is_some()),
        ("uncoded", arguments.uncoded),
        ("bits-per-token", arguments.bits_per_token.is_some()),
        ("remove", arguments.remove.is_some()),
        ("keep", arguments.keep.is_some()),
    ];
    if let Some((field, _)) = of_clip.into_iter().find(|(_, given)| *given) {
        return Err(Error::BadOption {
            field,
            reason: "it is of keys that read with a CLIP, not of --extractor hidden".into(),
        });
    }
    let options = HiddenKeyOptions {
        bits: arguments.bits,
        seed: arguments.seed,
        steps: arguments.steps,
        robust_to: arguments.robust_to,
    };
    let mut display = Display::new("decoder");
    create_hidden_key(&options, compute, &Stop::default(), |done, total| {
        display.set(done, total, String::new);
    })
}

fn tell(arguments: &Create, compute: &Compute, key: &Key, start: Instant) -> Result<()> {
    let report = Report {
        key: key.id(),
        bits: key.bits(),
        word_bits: key.word_bits(),
        bit_accuracy_unseen: key.accuracy_unseen,
        bit_accuracy_unseen_noisy: key.accuracy_unseen_noisy,
        clip: &key.clip.name,
        device: &compute.name,
        seconds: start.elapsed().as_secs_f64(),
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        let unseen = key
            .accuracy_unseen
            .map_or("unknown".into(), |a| format!("{:.2} %", 100.0 * a));
        print_line(&format!(
            "key {} of {} bits written to {}; bits of unseen {}: {unseen} ({:.0} s)",
            report.key,
            report.bits,
            arguments.output.display(),
            match arguments.extractor {
                Extractor::Clip => "messages read from their texts",
                Extractor::Hidden => "marked pictures read",
            },
            report.seconds
        ));
    }
    Ok(())
}
