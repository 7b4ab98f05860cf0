//! Tests of reading and writing compressed PLYs, and the files that they are made of.
mod garbage;
mod refusals;
mod round_trips;
mod values;

use crate::summary::tests::agrees;
use crate::{Error, Result, Scene, Sh};
use std::fmt::Write as _;
use std::path::Path;

/// An element under construction; its values are written as the types of their properties.
#[derive(Clone, Debug, Default)]
struct Element {
    name: &'static str,
    /// Types and names.
    columns: Vec<(&'static str, String)>,
    rows: Vec<Vec<f64>>,
    promised: Option<String>,
}

impl Element {
    fn new(name: &'static str, kind: &'static str, columns: &[&str], rows: Vec<Vec<f64>>) -> Element {
        Element {
            name,
            columns: columns.iter().map(|name| (kind, name.to_string())).collect(),
            rows,
            promised: None,
        }
    }

    fn column(&self, name: &str) -> usize {
        self.columns.iter().position(|(_, other)| other == name).unwrap()
    }

    fn set(&mut self, name: &str, row: usize, value: f64) {
        let column = self.column(name);
        self.rows[row][column] = value;
    }

    fn remove(&mut self, name: &str) {
        let column = self.column(name);
        self.columns.remove(column);
        self.rows.iter_mut().for_each(|row| _ = row.remove(column));
    }

    fn insert(&mut self, column: usize, kind: &'static str, name: &str, value: f64) {
        self.columns.insert(column, (kind, name.to_string()));
        self.rows.iter_mut().for_each(|row| row.insert(column, value));
    }

    /// Turns the order of the properties round.
    fn reverse(&mut self) {
        self.columns.reverse();
        self.rows.iter_mut().for_each(|row| row.reverse());
    }
}

/// A file under construction, so that a test can break one thing.
#[derive(Clone, Debug)]
struct File {
    format: &'static str,
    newline: &'static str,
    elements: Vec<Element>,
    /// Header lines and bytes after all elements.
    after: (String, Vec<u8>),
}

const GEOMETRY: [&str; 12] = super::layout::GEOMETRY;
const COLOUR: [&str; 6] = super::layout::COLOUR;
const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

impl File {
    /// A file of `rows` Gaussians, all bits of which are 0, in chunks whose ranges are 0 to 1.
    fn new(rows: usize, rest: usize) -> File {
        let range = |n: usize| [vec![0.0; n / 2], vec![1.0; n / 2]].concat();
        let chunk = [range(6), range(6), range(6)].concat();
        let names = [&GEOMETRY[..], &COLOUR[..]].concat();
        let mut elements = vec![
            Element::new("chunk", "float", &names, vec![chunk; rows.div_ceil(256)]),
            Element::new("vertex", "uint", &WORDS, vec![vec![0.0; 4]; rows]),
        ];
        if rest > 0 {
            let names: Vec<String> = (0..rest).map(|i| format!("f_rest_{i}")).collect();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            elements.push(Element::new("sh", "uchar", &names, vec![vec![128.0; rest]; rows]));
        }
        File {
            format: "binary_little_endian",
            newline: "\n",
            elements,
            after: Default::default(),
        }
    }

    fn element(&mut self, name: &str) -> &mut Element {
        self.elements.iter_mut().find(|element| element.name == name).unwrap()
    }

    fn chunk(&mut self) -> &mut Element {
        self.element("chunk")
    }

    fn vertex(&mut self) -> &mut Element {
        self.element("vertex")
    }

    fn sh(&mut self) -> &mut Element {
        self.element("sh")
    }

    /// As writers of 2023 did it.
    fn without_colour_ranges(mut self) -> File {
        COLOUR.iter().for_each(|name| self.chunk().remove(name));
        self
    }

    fn header(&self) -> String {
        let mut text = format!(
            "ply\nformat {} 1.0\ncomment made  by a test\nobj_info kept\n",
            self.format
        );
        for element in &self.elements {
            let count = element
                .promised
                .clone()
                .unwrap_or_else(|| element.rows.len().to_string());
            let _ = writeln!(text, "element {} {count}", element.name);
            for (kind, name) in &element.columns {
                let _ = writeln!(text, "property {kind} {name}");
            }
        }
        text += &self.after.0;
        text += "end_header\n";
        text.replace('\n', self.newline)
    }

    fn bytes(&self) -> Vec<u8> {
        let mut out = self.header().into_bytes();
        for element in &self.elements {
            for row in &element.rows {
                for ((kind, _), value) in element.columns.iter().zip(row) {
                    match *kind {
                        "uint" => out.extend((*value as u32).to_le_bytes()),
                        "int" => out.extend((*value as i32).to_le_bytes()),
                        "double" => out.extend(value.to_le_bytes()),
                        "uchar" => out.push(*value as u8),
                        _ => out.extend((*value as f32).to_le_bytes()),
                    }
                }
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
    let scene = Scene::parse(Path::new("test.compressed.ply"), bytes)?;
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
    let mut out = Vec::new();
    scene.encode(sh, &mut out).unwrap();
    out
}

/// What the scene says that a file keeps of colours.
fn kept(scene: &Scene, sh: &Sh) -> Sh {
    let mut kept = sh.clone();
    let rows = kept.coefficients.chunks_exact_mut(sh.per_gaussian());
    rows.enumerate()
        .for_each(|(row, colour)| scene.quantize_colors(row, colour));
    kept
}

fn bits(sh: &Sh) -> Vec<u32> {
    sh.coefficients.iter().map(|value| value.to_bits()).collect()
}
