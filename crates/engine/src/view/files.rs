//! Camera files: `cameras.json` of the 3DGS reference implementation, `transforms.json` of NeRF, and the cameras of a glTF.
//!
//! The first two store camera-to-world poses. `cameras.json` is an array whose entries have `position` and `rotation` (rows;
//! camera axes x right, y down, z forward are its columns), `width`, `height`, `fx`, `fy`. `transforms.json` is an
//! object with `frames`, each a `transform_matrix` whose camera axes are those of OpenGL (x right, y up, z backward),
//! and intrinsics for all frames or one: `camera_angle_x` or `fl_x`, `fl_y`, `cx`, `cy`, `w`, `h`. A glTF has OpenGL's axes too, and
//! no pixels: pictures are taken to be 800 high.
use super::camera::Camera;
use super::colmap;
use super::gltf::from_gltf;
use super::json::{self, Fields, Length, List, Outline, Scalar};
use super::vector::{cross, dot};
use crate::error::{Error, Result};
use crate::scene::{is_binary_gltf, write_whole};
use serde_json::{Value, json};
use std::io::Read;
use std::path::Path;

/// Longest camera file, bytes.
const MAX_FILE: u64 = 64 << 20;
/// Shortest text of a camera: a pose, whose fields are stated for all.
const MIN_ENTRY: usize = 60;
/// Widest and highest picture, pixels.
const MAX_SIDE: f64 = 16384.0;
/// Side of a picture where files do not state it: that of the NeRF synthetic set.
pub(super) const UNSTATED_SIDE: f64 = 800.0;

/// Reads cameras of any kind, told apart by their contents; of a folder, those of a COLMAP model.
///
/// Principal points that are not stated are the centre; sizes that a `transforms.json` does not state are 800 by 800,
/// those of the NeRF synthetic set. A glTF may be the scene itself; its perspective cameras are read.
///
/// # Errors
/// [`Error::Io`], or [`Error::BadCameras`] naming the camera and the field: not JSON, over 64 MiB (but for a binary glTF), no
/// kind of these, no camera in it, a field missing or not a finite number, a side outside 1 to 16384, a focal length not above zero, a
/// rotation that is none (unequal or skewed axes, a mirror).
pub fn read_cameras(path: &Path) -> Result<Vec<Camera>> {
    if path.is_dir() {
        return colmap::read(path);
    }
    let bad = |reason: String| Error::BadCameras {
        path: path.into(),
        reason,
    };
    let mut text = Vec::new();
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    file.take(MAX_FILE + 1)
        .read_to_end(&mut text)
        .map_err(Error::io(path))?;
    // Of a binary glTF what counts comes first.
    if text.len() as u64 > MAX_FILE && !is_binary_gltf(&text) {
        return Err(bad(format!("longer than the limit of {MAX_FILE} bytes")));
    }
    parse_cameras(&text).map_err(bad)
}

/// Writes cameras as `transforms.json` where the file's name has `transforms` in it, else as `cameras.json`.
///
/// Principal points off the centre are stated as `cx` and `cy`, which other readers of `cameras.json` ignore.
///
/// # Errors
/// [`Error::Io`]; the file appears whole or not at all.
pub fn write_cameras(path: &Path, cameras: &[Camera]) -> Result<()> {
    let nerf = path
        .file_name()
        .is_some_and(|n| n.to_string_lossy().contains("transforms"));
    let value = if nerf {
        json!({ "frames": cameras.iter().enumerate().map(frame).collect::<Vec<_>>() })
    } else {
        cameras.iter().enumerate().map(entry).collect()
    };
    write_whole(path, |out| {
        serde_json::to_writer_pretty(&mut *out, &value)?;
        out.write_all(b"\n")
    })?;
    Ok(())
}

/// Reads cameras of any kind from a file's bytes. Entries are read one by one: only the cameras are kept, not the
/// JSON, which would take many times its text. `Err` is the reason why not.
pub fn parse_cameras(text: &[u8]) -> Result<Vec<Camera>, String> {
    if is_binary_gltf(text) {
        return from_gltf(text);
    }
    let outline = json::outline(text)?;
    let (count, shared) = match &outline {
        Outline::Array(count) => (*count, None),
        Outline::Object(shared) if shared.asset.is_some() => return from_gltf(text),
        Outline::Object(shared) => match shared.frames {
            Some(Length(Some(count))) => (count, Some(&**shared)),
            _ => {
                return Err(
                    "no cameras.json (an array), transforms.json (with \"frames\") or glTF (with \"asset\")".into(),
                );
            }
        },
        Outline::Other => return Err("no cameras.json (an array), and no transforms.json or glTF (objects)".into()),
    };
    if count == 0 {
        return Err("has no cameras".into());
    }
    // No more than the text has room for: most entries may turn out to be no cameras.
    let mut cameras = Vec::with_capacity(count.min(text.len() / MIN_ENTRY));
    json::for_each(text, |own| {
        let camera = match shared {
            None => from_entry(&own),
            Some(shared) => from_frame(&own, shared),
        };
        cameras.push(camera?);
        Ok(())
    })?;
    Ok(cameras)
}

fn from_entry(own: &Fields) -> Result<Camera, String> {
    let need = |value: &Option<Scalar>, name: &str| number(value, name)?.ok_or_else(|| format!("{name} is missing"));
    let position = numbers(&own.position, "position")?;
    let rows = matrix(&own.rotation, "rotation")?;
    let axes = std::array::from_fn(|k| [rows[0][k], rows[1][k], rows[2][k]]);
    let size = [need(&own.width, "width")?, need(&own.height, "height")?];
    let principal = [number(&own.cx, "cx")?, number(&own.cy, "cy")?];
    assemble(
        axes,
        position,
        [need(&own.fx, "fx")?, need(&own.fy, "fy")?],
        principal,
        size,
    )
}

fn from_frame(own: &Fields, shared: &Fields) -> Result<Camera, String> {
    let find = |field: fn(&Fields) -> &Option<Scalar>, name: &str| {
        Ok::<_, String>(number(field(own), name)?.or(number(field(shared), name)?))
    };
    let rows = matrix(&own.transform_matrix, "transform_matrix")?;
    // OpenGL's y is up and its z backward.
    let axes = [(0, 1.0), (1, -1.0), (2, -1.0)].map(|(k, sign)| [0, 1, 2].map(|r| sign * rows[r][k]));
    let position = [rows[0][3], rows[1][3], rows[2][3]];
    let width = find(|f| &f.w, "w")?.unwrap_or(UNSTATED_SIDE);
    let height = find(|f| &f.h, "h")?.unwrap_or(UNSTATED_SIDE);
    let from_angle = |angle: Option<f64>, side: f64| angle.map(|angle| 0.5 * side / (0.5 * angle).tan());
    let fx = find(|f| &f.fl_x, "fl_x")?
        .or(from_angle(find(|f| &f.camera_angle_x, "camera_angle_x")?, width))
        .ok_or("neither fl_x nor camera_angle_x is given")?;
    let fy = find(|f| &f.fl_y, "fl_y")?
        .or(from_angle(find(|f| &f.camera_angle_y, "camera_angle_y")?, height))
        .unwrap_or(fx);
    let principal = [find(|f| &f.cx, "cx")?, find(|f| &f.cy, "cy")?];
    assemble(axes, position, [fx, fy], principal, [width, height])
}

/// Checks and assembles: `axes` are the camera's x, y and z in the world.
pub(super) fn assemble(
    axes: [[f64; 3]; 3],
    position: [f64; 3],
    focal: [f64; 2],
    principal: [Option<f64>; 2],
    size: [f64; 2],
) -> Result<Camera, String> {
    let rotation = axes.map(|axis| axis.map(|x| x as f32));
    let [x, y, z] = rotation;
    let skew = [
        dot(x, x) - 1.0,
        dot(y, y) - 1.0,
        dot(z, z) - 1.0,
        dot(x, y),
        dot(y, z),
        dot(x, z),
    ];
    if !skew.iter().all(|s| s.abs() < 1e-2) || dot(cross(x, y), z) < 0.0 {
        return Err("its rotation is not one: axes must have length 1, right angles and no mirror".into());
    }
    for (name, side) in [("width", size[0]), ("height", size[1])] {
        if !(1.0..=MAX_SIDE).contains(&side) || side.fract() != 0.0 {
            return Err(format!("{name} is {side}, must be a whole number from 1 to {MAX_SIDE}"));
        }
    }
    for (name, focal) in [("x", focal[0]), ("y", focal[1])] {
        if !(focal > 1e-6 && focal < 1e9) {
            return Err(format!("the focal length in {name} is {focal} pixels, must be above 0"));
        }
    }
    let principal = [0, 1].map(|i| principal[i].unwrap_or(0.5 * size[i]) as f32);
    for (name, principal) in ["cx", "cy"].iter().zip(principal) {
        if !principal.is_finite() {
            return Err(format!("{name} is out of range"));
        }
    }
    let position = position.map(|p| p as f32);
    let translation = rotation.map(|axis| -dot(axis, position));
    if translation.iter().any(|t| !t.is_finite()) {
        return Err(format!("its position {position:?} is out of range"));
    }
    Ok(Camera {
        width: size[0] as u32,
        height: size[1] as u32,
        fx: focal[0] as f32,
        fy: focal[1] as f32,
        cx: principal[0],
        cy: principal[1],
        rotation,
        translation,
    })
}

fn number(value: &Option<Scalar>, name: &str) -> Result<Option<f64>, String> {
    match value {
        None => Ok(None),
        Some(Scalar::Number(number)) => Ok(Some(*number)),
        Some(Scalar::Other(other)) => Err(format!("{name} is {other}, not a number")),
    }
}

fn numbers<const N: usize>(list: &Option<List<Scalar, N>>, name: &str) -> Result<[f64; N], String> {
    let found = list.as_ref().and_then(List::numbers);
    found.ok_or_else(|| format!("{name} is missing or not {N} numbers"))
}

fn matrix<const N: usize>(rows: &Option<List<List<Scalar, N>, N>>, name: &str) -> Result<[[f64; N]; N], String> {
    let rows = rows.as_ref().and_then(|rows| rows.0.as_ref());
    let mut found = [[0.0; N]; N];
    let all = rows.is_some_and(|rows| {
        let pairs = found.iter_mut().zip(rows);
        pairs
            .map(|(slot, row)| row.numbers().map(|row| *slot = row))
            .all(|row| row.is_some())
    });
    all.then_some(found)
        .ok_or_else(|| format!("{name} is missing or not {N} rows of {N} numbers"))
}

/// An entry of `cameras.json`.
fn entry((i, camera): (usize, &Camera)) -> Value {
    let rotation = transposed(camera.rotation);
    let mut entry = json!({
        "id": i,
        "img_name": format!("{i:05}"),
        "width": camera.width,
        "height": camera.height,
        "position": camera.centre(),
        "rotation": rotation,
        "fy": camera.fy,
        "fx": camera.fx,
    });
    let centred = [0.5 * camera.width as f32, 0.5 * camera.height as f32];
    if [camera.cx, camera.cy] != centred {
        entry["cx"] = json!(camera.cx);
        entry["cy"] = json!(camera.cy);
    }
    entry
}

/// A frame of `transforms.json`.
fn frame((i, camera): (usize, &Camera)) -> Value {
    let centre = camera.centre();
    let rows = transposed(camera.rotation);
    let row = |r: usize| [rows[r][0], -rows[r][1], -rows[r][2], centre[r]];
    json!({
        "file_path": format!("{i:05}"),
        "w": camera.width,
        "h": camera.height,
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "camera_angle_x": 2.0 * (0.5 * camera.width as f32 / camera.fx).atan(),
        "transform_matrix": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
    })
}

fn transposed(m: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[c][r]))
}

#[cfg(test)]
mod tests;
