//! The file layout of the reference implementation, for scenes that were not read from a file.
use crate::fields::{file_index, rest_count};
use crate::gaussians::{Gaussians, Sh};
use std::io::{self, Write};

/// Writes a binary little-endian PLY: x y z, normals of zero, `f_dc_*`, `f_rest_*`, opacity, `scale_*`, `rot_*`.
pub(crate) fn write(gaussians: &Gaussians, sh: &Sh, out: &mut impl Write) -> io::Result<()> {
    let rest = rest_count(sh.degree);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\n",
        gaussians.len()
    )?;
    let names = ["x", "y", "z", "nx", "ny", "nz"].map(String::from).into_iter();
    let names = names
        .chain((0..3).map(|i| format!("f_dc_{i}")))
        .chain((0..rest).map(|i| format!("f_rest_{i}")))
        .chain(std::iter::once("opacity".to_string()))
        .chain((0..3).map(|i| format!("scale_{i}")))
        .chain((0..4).map(|i| format!("rot_{i}")));
    for name in names {
        writeln!(out, "property float {name}")?;
    }
    out.write_all(b"end_header\n")?;
    // The coefficients in the order of the file.
    let mut order = vec![0; sh.per_gaussian()];
    for place in 0..order.len() {
        order[file_index(sh.degree, place)] = place;
    }
    let mut row: Vec<f32> = Vec::with_capacity(17 + rest);
    for (i, colour) in sh.coefficients.chunks_exact(sh.per_gaussian()).enumerate() {
        row.clear();
        row.extend(gaussians.positions[i]);
        row.extend([0.0; 3]);
        row.extend(order.iter().map(|k| colour[*k]));
        row.push(gaussians.opacity_logits[i]);
        row.extend(gaussians.log_scales[i]);
        row.extend(gaussians.rotations[i]);
        for value in &row {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(())
}
