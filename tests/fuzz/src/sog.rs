//! SOG: whole files, and their parts in a file that is right otherwise, since no change of a part gets through the
//! checksums of a ZIP.
use crate::memory::bounded;
use crate::scenes::check;
use guardsplat_scene::Scene;
use image_webp::{ColorType, WebPEncoder};
use std::io::{Cursor, Write};
use std::path::Path;
use std::sync::LazyLock;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// A `meta.json` of four Gaussians for the pictures of [`pictures`].
pub const META: &str = include_str!("meta.json");
/// The picture that [`sog_picture`] replaces, by the first byte of its input.
pub const PICTURES: [&str; 7] = [
    "means_l",
    "means_u",
    "quats",
    "scales",
    "sh0",
    "shN_centroids",
    "shN_labels",
];

/// Whole files, and a `meta.json` that lies about loosely.
pub fn sog(data: &[u8]) {
    if data.starts_with(b"PK") || data.trim_ascii_start().starts_with(b"{") {
        crate::scene(data);
    }
}

/// A `meta.json` in a ZIP with pictures that are as usual.
pub fn sog_meta(data: &[u8]) {
    read(&bundle(data, None));
    sog(data);
}

/// A picture in place of one that is as usual.
pub fn sog_picture(data: &[u8]) {
    if let Some((which, picture)) = data.split_first() {
        let which = usize::from(*which) % PICTURES.len();
        read(&bundle(META.as_bytes(), Some((which, picture))));
    }
}

fn read(file: &[u8]) {
    let scene = bounded(file.len(), || Scene::parse(Path::new("fuzz.sog"), file));
    if let Ok(scene) = scene {
        check(file, &scene);
    }
}

/// A ZIP of a `meta.json` and pictures, of which one may be replaced.
pub fn bundle(meta: &[u8], other: Option<(usize, &[u8])>) -> Vec<u8> {
    static USUAL: LazyLock<[Vec<u8>; 7]> = LazyLock::new(pictures);
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let mut add = |name: String, content: &[u8]| {
        zip.start_file(name, stored)?;
        zip.write_all(content)?;
        zip::result::ZipResult::Ok(())
    };
    add("meta.json".into(), meta).expect("memory takes a small file");
    for (i, name) in PICTURES.iter().enumerate() {
        let content = other
            .filter(|(which, _)| *which == i)
            .map_or(USUAL[i].as_slice(), |(_, content)| content);
        add(format!("{name}.webp"), content).expect("memory takes a small file");
    }
    zip.finish().expect("memory takes a small file").into_inner()
}

/// The usual pictures: four Gaussians of one band, of which the palette has 64 rows.
fn pictures() -> [Vec<u8>; 7] {
    PICTURES.map(|name| match name {
        "quats" => webp(2, 2, |i| [i as u8 * 50, 128, 90, 252 + i as u8]),
        "shN_centroids" => webp(192, 1, |i| [i as u8, 255 - i as u8, 7, 255]),
        "shN_labels" => webp(2, 2, |i| [i as u8 * 3, 0, 0, 255]),
        _ => webp(2, 2, |i| [i as u8 * 60, 200 - i as u8, 30, 100 + i as u8]),
    })
}

/// A lossless WebP.
pub fn webp(width: u32, height: u32, pixel: impl Fn(u32) -> [u8; 4]) -> Vec<u8> {
    let pixels: Vec<u8> = (0..width * height).flat_map(pixel).collect();
    let mut bytes = Vec::new();
    WebPEncoder::new(&mut bytes)
        .encode(&pixels, width, height, ColorType::Rgba8)
        .expect("memory takes a small picture");
    bytes
}
