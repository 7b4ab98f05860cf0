//! What is refused before anything of a file is written.
use crate::packed::decode::LARGEST_COLOUR;
use crate::range::C0;
use crate::sog::meta::MAX_LOG;
use crate::{Format, Gaussians, MAX_DEGREE};

/// Pixels of a side of a WebP picture at most, a multiple of 4 as the pictures of SOG are.
const WEBP_SIDE: usize = 16_380;

/// Whether the Gaussians are such as readers give, and fit into the format; `Err` is the reason why not.
pub(super) fn check(gaussians: &Gaussians, format: Format) -> Result<(), String> {
    check_arrays(gaussians)?;
    check_values(gaussians)?;
    let n = gaussians.len();
    match format {
        Format::Ply => Ok(()),
        Format::CompressedPly => check_colours(gaussians),
        Format::Ksplat if n == 0 => Err("no Gaussian; a .ksplat has one at least".to_string()),
        Format::Ksplat if u32::try_from(n).is_err() => {
            Err(format!("{n} Gaussians; the limit of .ksplat is {}", u32::MAX))
        }
        Format::Ksplat => Ok(()),
        Format::Splat if n == 0 => Err("no Gaussian; a .splat has one at least".to_string()),
        Format::Splat => Ok(()),
        Format::Spz if u32::try_from(n).is_err() => Err(format!("{n} Gaussians; the limit of SPZ is {}", u32::MAX)),
        Format::Spz => check_positions(gaussians, f64::from(super::spz::LARGEST), "SPZ"),
        Format::Gltf | Format::Glb if n == 0 => Err("no Gaussian; a glTF has one at least".to_string()),
        Format::Glb if super::gltf::bytes(gaussians) > super::gltf::MOST => Err(format!(
            "{n} Gaussians; a .glb has room for {} bytes of them",
            super::gltf::MOST
        )),
        Format::Gltf | Format::Glb => Ok(()),
        Format::Sog if n > WEBP_SIDE * WEBP_SIDE => {
            Err(format!("{n} Gaussians; the limit of SOG is {}", WEBP_SIDE * WEBP_SIDE))
        }
        Format::Sog => check_positions(gaussians, MAX_LOG.exp_m1(), "SOG"),
    }
}

/// Whether all arrays have a row for each Gaussian.
pub(crate) fn check_arrays(gaussians: &Gaussians) -> Result<(), String> {
    let n = gaussians.len();
    let sh = &gaussians.sh;
    if sh.degree > MAX_DEGREE {
        let degree = sh.degree;
        return Err(format!(
            "spherical harmonics of degree {degree}; the limit is {MAX_DEGREE}"
        ));
    }
    for (name, there, needed) in [
        ("rotations", gaussians.rotations.len(), n),
        ("log scales", gaussians.log_scales.len(), n),
        ("opacity logits", gaussians.opacity_logits.len(), n),
        ("coefficients", sh.coefficients.len(), n * sh.per_gaussian()),
    ] {
        if there != needed {
            return Err(format!("{there} {name} for {n} positions, must be {needed}"));
        }
    }
    Ok(())
}

/// Infinite opacity and flat axes exist in real files; nothing else may be infinite, and nothing NaN.
fn check_values(gaussians: &Gaussians) -> Result<(), String> {
    let wrong = |name: &str, row: usize, value: f32| Err(format!("{name} of row {row} is {value}"));
    let finite = |name: &str, values: &[f32], each: usize| match values.iter().position(|v| !v.is_finite()) {
        Some(i) => wrong(name, i / each, values[i]),
        None => Ok(()),
    };
    finite("a coordinate", gaussians.positions.as_flattened(), 3)?;
    finite("a component of the rotation", gaussians.rotations.as_flattened(), 4)?;
    let scales = gaussians.log_scales.as_flattened();
    if let Some(i) = scales.iter().position(|v| v.is_nan() || *v == f32::INFINITY) {
        return wrong("a log scale", i / 3, scales[i]);
    }
    if let Some(i) = gaussians.opacity_logits.iter().position(|v| v.is_nan()) {
        return wrong("the opacity logit", i, gaussians.opacity_logits[i]);
    }
    finite("a colour", &gaussians.sh.coefficients, gaussians.sh.per_gaussian())
}

fn check_positions(gaussians: &Gaussians, limit: f64, format: &str) -> Result<(), String> {
    let coordinates = gaussians.positions.as_flattened();
    match coordinates.iter().position(|v| f64::from(v.abs()) > limit) {
        None => Ok(()),
        Some(i) => {
            let (row, value) = (i / 3, coordinates[i]);
            Err(format!(
                "a coordinate of row {row} is {value:e}; the limit of {format} is {limit:e}"
            ))
        }
    }
}

/// Ends of ranges of colours have a limit.
fn check_colours(gaussians: &Gaussians) -> Result<(), String> {
    // A little less, so that rounding to single precision stays below the limit.
    let limit = f64::from(LARGEST_COLOUR) / C0 * 0.99;
    let rows = gaussians.sh.coefficients.chunks_exact(gaussians.sh.per_gaussian());
    for (row, colour) in rows.enumerate() {
        if let Some(value) = colour[..3].iter().find(|v| f64::from(v.abs()) > limit) {
            return Err(format!(
                "a constant colour of row {row} is {value:e}; the limit of a compressed PLY is {limit:e}"
            ));
        }
    }
    Ok(())
}
