//! Tests of reading and writing, and the files that they are made of.
mod folders;
mod formulas;
mod garbage;
mod ignored;
mod limits;
mod pictures;
mod real;
mod refusals;
mod round_trips;
mod streamed;

use crate::{Error, Result, Scene, Sh};
use image_webp::{ColorType, WebPEncoder};
use serde_json::{Value, json};
use std::io::{Cursor, Read, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Width of the pictures of [`File`].
const WIDTH: usize = 4;
/// Rows of the palette of [`File`]: more than are side by side in the picture.
const PALETTE: usize = 70;

/// A file under construction, so that a test can break one thing.
#[derive(Clone)]
struct File {
    meta: Value,
    /// Name, width and pixels.
    pictures: Vec<(&'static str, usize, Vec<[u8; 4]>)>,
    /// Whatever else is in the archive, in front.
    others: Vec<(String, Vec<u8>)>,
    method: CompressionMethod,
}

impl File {
    /// A file of `rows` Gaussians with arbitrary pixels; the pictures have more pixels than that.
    fn new(version: u64, bands: usize, rows: usize) -> File {
        let pixels = WIDTH * (rows / WIDTH + 1);
        let mut pictures: Vec<_> = ["means_l", "means_u", "scales", "quats", "sh0"]
            .into_iter()
            .enumerate()
            .map(|(salt, name)| (name, WIDTH, noise(pixels, salt)))
            .collect();
        pictures[3].2.iter_mut().for_each(|texel| texel[3] |= 252);
        let list = |salt: usize| -> Vec<f64> { (0..256).map(|i| (i * (salt + 3)) as f64 * 0.01 - 2.5).collect() };
        let mut meta = json!({
            "means": {"mins": [-1.0, -2.0, 0.5], "maxs": [1.5, 2.0, 0.75], "files": ["means_l", "means_u"]},
            "scales": {"files": ["scales"]},
            "quats": {"files": ["quats"]},
            "sh0": {"files": ["sh0"]},
            "something": {"new": [1, 2, 3]},
        });
        if version == 2 {
            meta["version"] = 2.into();
            meta["count"] = rows.into();
            meta["scales"]["codebook"] = list(0).into();
            meta["sh0"]["codebook"] = list(1).into();
        } else {
            meta["means"]["shape"] = json!([rows, 3]);
            meta["quats"]["encoding"] = "quaternion_packed".into();
            meta["scales"]["mins"] = json!([-9.0, -8.0, -7.0]);
            meta["scales"]["maxs"] = json!([-1.0, -2.0, -3.0]);
            meta["sh0"]["mins"] = json!([-2.0, -1.5, -1.0, -5.0]);
            meta["sh0"]["maxs"] = json!([2.0, 2.5, 3.0, 5.0]);
        }
        if bands > 0 {
            let coefficients = (bands + 1) * (bands + 1) - 1;
            meta["shN"] = json!({"files": ["shN_centroids", "shN_labels"]});
            if version == 2 {
                meta["shN"]["bands"] = bands.into();
                meta["shN"]["count"] = PALETTE.into();
                meta["shN"]["codebook"] = list(2).into();
            } else {
                meta["shN"]["mins"] = json!(-1.0);
                meta["shN"]["maxs"] = json!(1.5);
            }
            let mut labels = noise(pixels, 5);
            for texel in &mut labels {
                *texel = [texel[0] % PALETTE as u8, 0, 0, 255];
            }
            pictures.push(("shN_centroids", 64 * coefficients, noise(2 * 64 * coefficients, 6)));
            pictures.push(("shN_labels", WIDTH, labels));
        }
        File {
            meta,
            pictures,
            others: Vec::new(),
            method: CompressionMethod::Stored,
        }
    }

    /// Sets the value at a JSON pointer whose parent is there.
    fn with(mut self, pointer: &str, value: Value) -> File {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match self.meta.pointer_mut(parent).unwrap() {
            Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
            object => object[key] = value,
        }
        self
    }

    /// Removes the value at a JSON pointer.
    fn without(mut self, pointer: &str) -> File {
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        let parent = self.meta.pointer_mut(parent).unwrap().as_object_mut().unwrap();
        parent.remove(key).unwrap();
        self
    }

    /// The pixels of a picture.
    fn pixels(&mut self, name: &str) -> &mut Vec<[u8; 4]> {
        &mut self.pictures.iter_mut().find(|(other, ..)| *other == name).unwrap().2
    }

    /// The same with one pixel changed.
    fn pixel(mut self, name: &str, i: usize, texel: [u8; 4]) -> File {
        self.pixels(name)[i] = texel;
        self
    }

    /// The entries of the archive.
    fn entries(&self) -> Vec<(String, Vec<u8>)> {
        let mut entries = self.others.clone();
        for (name, width, pixels) in &self.pictures {
            entries.push(((*name).to_string(), webp(*width, pixels)));
        }
        entries.push(("meta.json".to_string(), self.meta.to_string().into_bytes()));
        entries
    }

    fn bytes(&self) -> Vec<u8> {
        zip(&self.entries(), self.method)
    }

    fn read(&self) -> Result<Scene> {
        read(&self.bytes())
    }

    /// The reason for which the file is refused.
    fn refused(&self) -> String {
        refused(&self.bytes())
    }
}

/// Arbitrary pixels.
fn noise(pixels: usize, salt: usize) -> Vec<[u8; 4]> {
    let byte = |i: usize, channel: usize| (i * 97 + channel * 61 + i * i * (salt + channel) * 7 + salt * 29) as u8;
    (0..pixels)
        .map(|i| std::array::from_fn(|channel| byte(i, channel)))
        .collect()
}

fn webp(width: usize, pixels: &[[u8; 4]]) -> Vec<u8> {
    let mut out = Vec::new();
    let height = pixels.len() / width;
    WebPEncoder::new(&mut out)
        .encode(pixels.as_flattened(), width as u32, height as u32, ColorType::Rgba8)
        .unwrap();
    out
}

fn zip(entries: &[(String, Vec<u8>)], method: CompressionMethod) -> Vec<u8> {
    let mut out = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, content) in entries {
        out.start_file(name, options).unwrap();
        out.write_all(content).unwrap();
    }
    out.finish().unwrap().into_inner()
}

/// The entries of an archive, unpacked.
fn unzip(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut zip = ZipArchive::new(Cursor::new(bytes)).unwrap();
    let count = zip.len();
    let entry = |i| {
        let mut entry = zip.by_index(i).unwrap();
        let mut content = Vec::new();
        entry.read_to_end(&mut content).unwrap();
        (entry.name().unwrap().into_owned(), content)
    };
    (0..count).map(entry).collect()
}

fn read(bytes: &[u8]) -> Result<Scene> {
    Scene::parse(Path::new("test.sog"), bytes)
}

fn refused(bytes: &[u8]) -> String {
    match read(bytes) {
        Err(Error::BadScene { reason, .. }) => reason,
        Err(other) => panic!("{other}"),
        Ok(scene) => panic!("{} Gaussians were read", scene.gaussians.len()),
    }
}

fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let mut out = Vec::new();
    scene.encode(sh, &mut out).unwrap();
    out
}

/// Colours of `scene` with `change` made to the constant ones and what a file keeps of that.
fn changed(scene: &Scene, mut change: impl FnMut(usize, f32) -> f32) -> Sh {
    let mut sh = scene.gaussians.sh.clone();
    let per_gaussian = sh.per_gaussian();
    for (row, colour) in sh.coefficients.chunks_exact_mut(per_gaussian).enumerate() {
        for (channel, value) in colour[..3].iter_mut().enumerate() {
            *value = change(3 * row + channel, *value);
        }
        scene.quantize_colors(row, colour);
    }
    sh
}

/// Coefficients bit by bit.
fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}
