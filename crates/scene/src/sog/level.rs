//! A level of detail of a SOG that is streamed: the SOGs of all its tiles, which are read as one scene and written as a
//! streamed SOG of that level alone.
use super::index::{Unit, of_one_level};
use super::streamed::INDEX;
use crate::atomic_write::write_folder_whole;
use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use crate::{Error, Result};
use std::fs::{self, File};
use std::io::{self, BufReader, Write};
use std::path::Path;
use std::sync::Arc;

/// A level as it was read.
#[derive(Debug)]
struct Level {
    parts: Vec<Part>,
    ignored: Ignored,
}

/// One of its files.
#[derive(Debug)]
struct Part {
    unit: Unit,
    /// The first of its Gaussians among those of the level.
    first: usize,
    gaussians: usize,
    /// Degree of its spherical harmonics.
    degree: usize,
    own: Arc<dyn Container>,
}

/// Reads the files of a level that lie below `folder`, one after the other, within `memory` bytes.
pub(super) fn read(
    folder: &Path,
    units: &[Unit],
    bad_rows: BadRows,
    memory: u64,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let (mut all, mut parts, mut ignored) = (Gaussians::default(), Vec::new(), Ignored::default());
    let (mut left, mut rows) = (memory, 0);
    for unit in units {
        let path = folder.join(unit.path());
        let (gaussians, own) = match path.is_dir() {
            true => super::read_folder(&path, bad_rows, left)?,
            false => read_bundle(&path, bad_rows, left)?,
        };
        let bad_ones = own.ignored().map_or(0, Ignored::count);
        let there = gaussians.len() + bad_ones;
        if there as u64 != unit.gaussians {
            let told = unit.gaussians;
            return Err(bad(&path, format!("{there} Gaussians, of which {INDEX} has {told}")));
        }
        let numbers = 4 * (11 + gaussians.sh.per_gaussian()) * gaussians.len();
        left = left.saturating_sub((own.bytes() + numbers) as u64);
        if let Some(own) = own.ignored() {
            ignored.append(own, rows, &unit.name);
        }
        rows += there;
        parts.push(Part {
            unit: unit.clone(),
            first: all.len(),
            gaussians: gaussians.len(),
            degree: gaussians.sh.degree,
            own,
        });
        append(&mut all, gaussians);
    }
    Ok((all, Arc::new(Level { parts, ignored })))
}

fn read_bundle(path: &Path, bad_rows: BadRows, memory: u64) -> Result<(Gaussians, Arc<dyn Container>)> {
    let file = File::open(path).map_err(Error::io(path))?;
    let metadata = file.metadata().map_err(Error::io(path))?;
    if !metadata.is_file() {
        return Err(bad(path, "not a regular file".to_string()));
    }
    super::read(path, &mut BufReader::new(file), metadata.len(), bad_rows, memory)
}

/// Puts Gaussians behind others; bands that only some have are 0 for the rest.
fn append(all: &mut Gaussians, more: Gaussians) {
    let degree = all.sh.degree.max(more.sh.degree);
    widen(&mut all.sh, degree);
    let mut sh = more.sh;
    widen(&mut sh, degree);
    all.positions.extend(more.positions);
    all.rotations.extend(more.rotations);
    all.log_scales.extend(more.log_scales);
    all.opacity_logits.extend(more.opacity_logits);
    all.sh.coefficients.extend(sh.coefficients);
}

fn widen(sh: &mut Sh, degree: usize) {
    if degree > sh.degree {
        *sh = resized(&sh.coefficients, sh.degree, degree);
    }
}

/// Coefficients of degree `from` as such of another degree.
fn resized(coefficients: &[f32], from: usize, degree: usize) -> Sh {
    let [old, new] = [from, degree].map(|degree| 3 * (degree + 1) * (degree + 1));
    let mut sh = Sh {
        degree,
        coefficients: Vec::with_capacity(coefficients.len() / old * new),
    };
    for row in coefficients.chunks_exact(old) {
        let zeros = std::iter::repeat_n(0.0, new.saturating_sub(old));
        sh.coefficients.extend(row.iter().copied().take(new).chain(zeros));
    }
    sh
}

impl Container for Level {
    fn format(&self) -> Format {
        Format::Sog
    }

    fn bytes(&self) -> usize {
        self.parts.iter().map(|part| part.own.bytes()).sum()
    }

    fn exact(&self) -> bool {
        self.parts.iter().all(|part| part.own.exact())
    }

    fn learnable_degree(&self, scene: usize) -> usize {
        let least = self.parts.iter().map(|part| part.own.learnable_degree(scene)).min();
        least.unwrap_or(scene)
    }

    fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        let after = self.parts.partition_point(|part| part.first <= row);
        let part = &self.parts[after - 1];
        let (own, beyond) = coefficients.split_at_mut(3 * (part.degree + 1) * (part.degree + 1));
        part.own.quantize_colors(row - part.first, own);
        beyond.fill(0.0);
    }

    fn ignored(&self) -> Option<&Ignored> {
        self.ignored.if_any()
    }

    fn is_one_file(&self) -> bool {
        false
    }

    fn write(&self, _sh: &Sh, _out: &mut dyn Write) -> io::Result<()> {
        Err(io::Error::other(format!(
            "a SOG with a {INDEX} is written as a folder, and not as one file"
        )))
    }

    /// As a streamed SOG of one level in a folder, which must not be there yet.
    fn write_at(&self, sh: &Sh, path: &Path) -> Result<()> {
        if Format::of_name(path) == Some(Format::Sog) {
            return Err(bad(
                path,
                format!("a SOG with a {INDEX} is written as a folder; leave .sog out"),
            ));
        }
        write_folder_whole(path, |aside| {
            let index = of_one_level(self.parts.iter().map(|part| &part.unit));
            let to = aside.join(INDEX);
            fs::write(&to, index).map_err(Error::io(to))?;
            let each = sh.per_gaussian();
            for part in &self.parts {
                let to = aside.join(part.unit.path());
                let parent = to.parent().unwrap_or(aside);
                fs::create_dir_all(parent).map_err(Error::io(parent))?;
                let rows = part.first * each..(part.first + part.gaussians) * each;
                part.own
                    .write_at(&resized(&sh.coefficients[rows], sh.degree, part.degree), &to)?;
            }
            Ok(())
        })
    }
}
