//! Tests of reading and writing, and the files that they are made of.
mod garbage;
mod ignored;
mod refusals;
mod round_trips;
mod trainers;

use crate::fields::rest_count;
use crate::summary::tests::agrees;
use crate::{Error, MAX_DEGREE, Result, Scene, Sh};
use std::fmt::Write as _;
use std::path::Path;

#[derive(Clone, Copy, PartialEq, Debug)]
enum Encoding {
    Ascii,
    Little,
    Big,
}
const ENCODINGS: [Encoding; 3] = [Encoding::Ascii, Encoding::Little, Encoding::Big];

/// A file under construction: properties with values a row, so that a test can break one thing.
struct File {
    encoding: Encoding,
    newline: &'static str,
    names: Vec<(String, &'static str)>,
    rows: Vec<Vec<f64>>,
    promised: Option<String>,
    before: (String, Vec<u8>),
    after: (String, Vec<u8>),
}

impl File {
    fn new(encoding: Encoding, degree: usize, rows: usize) -> File {
        let mut names = vec!["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity"]
            .into_iter()
            .map(String::from)
            .collect::<Vec<_>>();
        // The order of properties is the file's own business: here rests are last and reversed.
        names.extend((0..3).map(|i| format!("scale_{i}")));
        names.extend((0..4).map(|i| format!("rot_{i}")));
        names.extend((0..rest_count(degree)).rev().map(|i| format!("f_rest_{i}")));
        let columns = names.len();
        File {
            encoding,
            newline: "\n",
            names: names.into_iter().map(|n| (n, "float")).collect(),
            rows: (0..rows)
                .map(|r| {
                    (0..columns)
                        .map(|c| f64::from(0.25 * (r * columns + c) as f32 - 7.0))
                        .collect()
                })
                .collect(),
            promised: None,
            before: Default::default(),
            after: Default::default(),
        }
    }

    fn column(&self, name: &str) -> usize {
        self.names.iter().position(|(n, _)| n == name).unwrap()
    }

    fn with(mut self, name: &str, row: usize, value: f64) -> File {
        let column = self.column(name);
        self.rows[row][column] = value;
        self
    }

    fn add(mut self, name: &str, kind: &'static str, value: f64) -> File {
        self.names.insert(3, (name.to_string(), kind));
        self.rows.iter_mut().for_each(|row| row.insert(3, value));
        self
    }

    fn without(mut self, name: &str) -> File {
        let column = self.column(name);
        self.names.remove(column);
        for row in &mut self.rows {
            row.remove(column);
        }
        self
    }

    fn header(&self) -> String {
        let format = match self.encoding {
            Encoding::Ascii => "ascii",
            Encoding::Little => "binary_little_endian",
            Encoding::Big => "binary_big_endian",
        };
        let promised = self.promised.clone().unwrap_or_else(|| self.rows.len().to_string());
        let mut text = format!("ply\nformat {format} 1.0\ncomment made  by a test\nobj_info kept\n");
        text += &self.before.0;
        let _ = writeln!(text, "element vertex {promised}");
        for (name, kind) in &self.names {
            let _ = writeln!(text, "property {kind} {name}");
        }
        text += &self.after.0;
        text += "end_header\n";
        text.replace('\n', self.newline)
    }

    fn bytes(&self) -> Vec<u8> {
        let mut out = self.header().into_bytes();
        out.extend(&self.before.1);
        let mut put = |little: &[u8]| match self.encoding {
            Encoding::Big => out.extend(little.iter().rev()),
            _ => out.extend(little),
        };
        for row in &self.rows {
            for ((_, kind), value) in self.names.iter().zip(row) {
                match (self.encoding, *kind) {
                    (Encoding::Ascii, _) => put(format!("{value} ").as_bytes()),
                    (_, "double") => put(&value.to_le_bytes()),
                    (_, "uchar") => put(&[*value as u8]),
                    (_, "int") => put(&(*value as i32).to_le_bytes()),
                    _ => put(&(*value as f32).to_le_bytes()),
                }
            }
            if self.encoding == Encoding::Ascii {
                put(self.newline.as_bytes());
            }
        }
        out.extend(&self.after.1);
        out
    }

    fn read(&self) -> Result<Scene> {
        read(&self.bytes())
    }

    /// The reason for which the file is refused.
    fn refused(&self) -> String {
        refused(&self.bytes())
    }
}

fn read(bytes: &[u8]) -> Result<Scene> {
    let scene = Scene::parse(Path::new("test.ply"), bytes)?;
    agrees(bytes, &scene);
    Ok(scene)
}

fn refused(bytes: &[u8]) -> String {
    match read(bytes) {
        Err(Error::BadScene { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.ply");
    scene.write(&path, sh).unwrap();
    std::fs::read(path).unwrap()
}
