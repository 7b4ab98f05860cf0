//! AVIF: written and read again by `avifenc` and `avifdec`, programs of libavif.
//!
//! Encoders in pure Rust take minutes to build, and what decodes is C with an assembler. The programs are in Debian's
//! package libavif-bin.
use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

use image::RgbImage;

use crate::{Error, Result};

/// What writes.
pub(super) const ENCODER: &str = "avifenc";
/// What reads.
const DECODER: &str = "avifdec";
/// Debian's package of both.
pub(super) const PACKAGE: &str = "libavif-bin";

/// AVIF of a quality of 0 to 100, 4:2:0 in 8 bits, at the encoder's default speed.
pub(super) fn written(picture: &RgbImage, quality: u8) -> Result<RgbImage> {
    let folder = tempfile::tempdir().map_err(|error| failed(error.to_string()))?;
    let [input, file, output] = ["in.png", "file.avif", "out.png"].map(|name| folder.path().join(name));
    picture.save(&input).map_err(|error| failed(error.to_string()))?;
    // The quantiser that libavif 1.0 makes of a quality; told by its number, it means the same to older versions.
    let level = ((100 - u32::from(quality.min(100))) * 63 + 50) / 100;
    let level = format!("cq-level={level}");
    let options = [
        "-j", "1", "-d", "8", "-y", "420", "-s", "6", "-c", "aom", "--min", "0", "--max", "63",
    ];
    run(ENCODER, &options, &["-a", "end-usage=q", "-a", &level], [&input, &file])?;
    run(DECODER, &["-j", "1", "-d", "8"], &[], [&file, &output])?;
    let read = image::open(&output).map_err(|error| failed(error.to_string()))?;
    Ok(read.into_rgb8())
}

/// Whether both programs can be started.
pub(super) fn is_installed() -> bool {
    [ENCODER, DECODER].iter().all(|program| {
        let version = Command::new(program)
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status();
        version.is_ok()
    })
}

fn run(program: &str, options: &[&str], more: &[&str], files: [&Path; 2]) -> Result<()> {
    let answer = Command::new(program)
        .args(options)
        .args(more)
        .args(files)
        .stdin(Stdio::null())
        .output();
    let answer = answer.map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => failed(missing(program)),
        _ => failed(format!("{program}: {error}")),
    })?;
    if answer.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&answer.stderr);
    Err(failed(format!("{program}: {}", said.trim())))
}

/// What to do about a program that is not there.
pub(super) fn missing(program: &str) -> String {
    format!("the program {program} was not found; Debian's package {PACKAGE} has it")
}

fn failed(reason: String) -> Error {
    Error::Codec { codec: "avif", reason }
}
