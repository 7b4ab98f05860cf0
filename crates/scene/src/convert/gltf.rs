//! glTF with KHR_gaussian_splatting: a node with one primitive, whose attributes lie one after the other in one buffer.
//!
//! Without `COLOR_0`, with which programs show splats that do not know them: it would keep colours of a scene that is
//! marked later.
use super::values::{opacity, unit};
use crate::Gaussians;
use crate::gltf::primitive::{EXTENSION, MAX_DEGREE, harmonic};
use base64::engine::general_purpose::STANDARD;
use base64::write::EncoderWriter;
use serde_json::{Value, json};
use std::io::{self, Write};

/// Bytes of Gaussians that fit into a binary file besides its JSON, whose lengths have 32 bits.
pub(super) const MOST: u64 = u32::MAX as u64 - (1 << 20);
/// Numbers of a Gaussian besides its colour.
const GEOMETRY: usize = 11;

/// Bytes of the buffer, of as many bands as a file may have.
pub(super) fn bytes(gaussians: &Gaussians) -> u64 {
    length(gaussians.len(), gaussians.sh.degree.min(MAX_DEGREE)) as u64
}

fn length(gaussians: usize, degree: usize) -> usize {
    4 * gaussians * (GEOMETRY + 3 * (degree + 1) * (degree + 1))
}

/// Writes checked Gaussians as JSON with the buffer in it.
pub(super) fn write_text(gaussians: &Gaussians, degree: usize, out: &mut dyn Write) -> io::Result<()> {
    const START: &str = "data:application/octet-stream;base64,";
    let text = document(gaussians, degree, Some(START)).to_string();
    let (before, after) = text.split_at(text.find(START).unwrap_or(0) + START.len());
    out.write_all(before.as_bytes())?;
    let mut encoder = EncoderWriter::new(&mut *out, &STANDARD);
    write_buffer(gaussians, degree, &mut encoder)?;
    encoder.finish()?;
    drop(encoder);
    out.write_all(after.as_bytes())
}

/// Writes checked Gaussians as a binary file.
pub(super) fn write_binary(gaussians: &Gaussians, degree: usize, out: &mut dyn Write) -> io::Result<()> {
    let mut text = document(gaussians, degree, None).to_string();
    text += &" ".repeat(text.len().next_multiple_of(4) - text.len());
    let buffer = length(gaussians.len(), degree);
    let word = |length: usize| u32::try_from(length).map(u32::to_le_bytes).map_err(io::Error::other);
    out.write_all(b"glTF\x02\0\0\0")?;
    out.write_all(&word(12 + 8 + text.len() + 8 + buffer)?)?;
    out.write_all(&word(text.len())?)?;
    out.write_all(b"JSON")?;
    out.write_all(text.as_bytes())?;
    out.write_all(&word(buffer)?)?;
    out.write_all(b"BIN\0")?;
    write_buffer(gaussians, degree, out)
}

/// The JSON of a file whose buffer is at `uri`.
fn document(gaussians: &Gaussians, degree: usize, uri: Option<&str>) -> Value {
    let n = gaussians.len();
    let own = |name: &str| format!("{EXTENSION}:{name}");
    let fixed = [
        ("POSITION".to_string(), 3),
        (own("ROTATION"), 4),
        (own("SCALE"), 3),
        (own("OPACITY"), 1),
    ];
    let colours = (0..(degree + 1) * (degree + 1)).map(|i| (harmonic(i), 3));
    let (mut attributes, mut accessors, mut views) = (serde_json::Map::new(), Vec::new(), Vec::new());
    let mut offset = 0;
    for (i, (name, width)) in fixed.into_iter().chain(colours).enumerate() {
        attributes.insert(name, json!(i));
        let kind = match width {
            1 => "SCALAR",
            3 => "VEC3",
            _ => "VEC4",
        };
        accessors.push(json!({ "bufferView": i, "componentType": 5126, "count": n, "type": kind }));
        views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": 4 * width * n, "target": 34962 }));
        offset += 4 * width * n;
    }
    // Positions must have them.
    let ends = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
        let axis = |i: usize| gaussians.positions.iter().map(move |p| p[i]).reduce(pick);
        (0..3).filter_map(axis).collect()
    };
    accessors[0]["min"] = json!(ends(f32::min));
    accessors[0]["max"] = json!(ends(f32::max));
    let mut buffer = json!({ "byteLength": offset });
    if let Some(uri) = uri {
        buffer["uri"] = json!(uri);
    }
    let splatting = json!({
        "kernel": "ellipse",
        "colorSpace": "srgb_rec709_display",
        "projection": "perspective",
        "sortingMethod": "cameraDistance",
    });
    json!({
        "asset": { "version": "2.0", "generator": "GuardSplat" },
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "mode": 0, "attributes": attributes, "extensions": { EXTENSION: splatting } }] }],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [buffer],
    })
}

/// Attribute after attribute.
fn write_buffer(gaussians: &Gaussians, degree: usize, out: &mut dyn Write) -> io::Result<()> {
    let mut put = |value: f32| out.write_all(&value.to_le_bytes());
    gaussians.positions.as_flattened().iter().try_for_each(|v| put(*v))?;
    for rotation in &gaussians.rotations {
        let [w, x, y, z] = unit(*rotation);
        [x, y, z, w].into_iter().try_for_each(|v| put(v as f32))?;
    }
    // The largest deviations are in single precision by force.
    let scales = gaussians.log_scales.as_flattened().iter();
    scales
        .map(|log| (f64::from(*log).exp() as f32).min(f32::MAX))
        .try_for_each(&mut put)?;
    let opacities = gaussians.opacity_logits.iter();
    opacities.map(|logit| opacity(*logit) as f32).try_for_each(&mut put)?;
    let each = gaussians.sh.per_gaussian();
    for i in 0..(degree + 1) * (degree + 1) {
        for row in gaussians.sh.coefficients.chunks_exact(each) {
            row[3 * i..3 * i + 3].iter().try_for_each(|v| put(*v))?;
        }
    }
    Ok(())
}
