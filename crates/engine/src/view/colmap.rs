//! Cameras of a COLMAP model: a folder with `cameras` and `images`, both `.bin` or both `.txt`
//! (<https://colmap.github.io/format.html>). Images are taken in the order of their names, as 3DGS takes them.
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::camera::Camera;
use super::files::assemble;
use super::vector::rotation;
use crate::error::{Error, Result};

/// Models by their numbers: the name, how many parameters there are, and how many of the first are focal lengths. Lenses
/// that bend straight lines are taken as if they did not, since scenes are trained from straightened pictures.
const MODELS: [(&str, usize, Option<usize>); 11] = [
    ("SIMPLE_PINHOLE", 3, Some(1)),
    ("PINHOLE", 4, Some(2)),
    ("SIMPLE_RADIAL", 4, Some(1)),
    ("RADIAL", 5, Some(1)),
    ("OPENCV", 8, Some(2)),
    // Wider than a plane picture can be.
    ("OPENCV_FISHEYE", 8, None),
    ("FULL_OPENCV", 12, Some(2)),
    ("FOV", 5, None),
    ("SIMPLE_RADIAL_FISHEYE", 4, None),
    ("RADIAL_FISHEYE", 5, None),
    ("THIN_PRISM_FISHEYE", 12, None),
];
/// Most cameras, and most images.
const MOST: usize = 1 << 20;
/// Longest line that is a camera or an image, and longest name, bytes.
const LONGEST: u64 = 1 << 16;
/// Bytes of a point of an image: x, y, and its number.
const POINT: u64 = 24;

/// A lens with its sensor.
struct Intrinsics {
    size: [f64; 2],
    focal: [f64; 2],
    principal: [f64; 2],
}

/// Where an image was taken: a rotation (w, x, y, z) and a translation from the world to the camera.
struct Pose {
    rotation: [f64; 4],
    translation: [f64; 3],
    camera: u32,
    name: Vec<u8>,
}

/// Reads a folder.
///
/// # Errors
/// [`Error::Io`], or [`Error::BadCameras`] naming the file, and the camera, the image or the line: neither kind of model,
/// a lens that is none of a plane picture, an image without its camera, cut files, and what a camera must not be.
pub(super) fn read(folder: &Path) -> Result<Vec<Camera>> {
    let binary = folder.join("images.bin").is_file();
    let kind = if binary { "bin" } else { "txt" };
    let [cameras, images] = ["cameras", "images"].map(|name| folder.join(name).with_extension(kind));
    let open = |path: &Path| File::open(path).map(BufReader::new).map_err(Error::io(path));
    let found = match binary {
        true => binary_cameras(&mut open(&cameras)?),
        false => text_cameras(&mut open(&cameras)?),
    }
    .map_err(bad(&cameras))?;
    let mut poses = match binary {
        true => binary_images(&mut open(&images)?),
        false => text_images(&mut open(&images)?),
    }
    .map_err(bad(&images))?;
    poses.sort_by(|a, b| a.name.cmp(&b.name));
    let placed = poses
        .iter()
        .map(|pose| placed(pose, &found))
        .collect::<Result<Vec<_>, _>>();
    let placed = placed.map_err(bad(&images))?;
    match placed.is_empty() {
        true => Err(bad(&images)("has no images".into())),
        false => Ok(placed),
    }
}

fn bad(path: &Path) -> impl Fn(String) -> Error {
    let path = path.to_owned();
    move |reason| Error::BadCameras {
        path: path.clone(),
        reason,
    }
}

fn placed(pose: &Pose, cameras: &HashMap<u32, Intrinsics>) -> Result<Camera, String> {
    let told = |reason: String| format!("image {}: {reason}", pose.name.escape_ascii());
    let lens = cameras.get(&pose.camera);
    let lens = lens.ok_or_else(|| told(format!("there is no camera {}", pose.camera)))?;
    let length = pose.rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    let axes = rotation(pose.rotation.map(|v| v / length));
    // The centre c has R c + t = 0.
    let position = std::array::from_fn(|c| -(0..3).map(|r| axes[r][c] * pose.translation[r]).sum::<f64>());
    let principal = lens.principal.map(Some);
    assemble(axes, position, lens.focal, principal, lens.size).map_err(told)
}

fn intrinsics(model: usize, size: [f64; 2], parameters: &[f64]) -> Result<Intrinsics, String> {
    let (name, _, focals) = MODELS[model];
    let focals = focals.ok_or_else(|| format!("{name} is no lens of a plane picture; undistort the images first"))?;
    Ok(Intrinsics {
        size,
        focal: [parameters[0], parameters[focals - 1]],
        principal: [parameters[focals], parameters[focals + 1]],
    })
}

fn count(number: u64, what: &str) -> Result<usize, String> {
    let small = usize::try_from(number).ok().filter(|&number| number <= MOST);
    small.ok_or_else(|| format!("has {number} {what}, at most {MOST} are read"))
}

fn bytes<const N: usize>(file: &mut impl Read) -> Result<[u8; N], String> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes)
        .map_err(|error| format!("ends too early: {error}"))?;
    Ok(bytes)
}

fn floats<const N: usize>(file: &mut impl Read) -> Result<[f64; N], String> {
    let mut found = [0.0; N];
    for value in &mut found {
        *value = f64::from_le_bytes(bytes(file)?);
    }
    Ok(found)
}

fn binary_cameras(file: &mut impl BufRead) -> Result<HashMap<u32, Intrinsics>, String> {
    let cameras = count(u64::from_le_bytes(bytes(file)?), "cameras")?;
    let mut found = HashMap::new();
    for _ in 0..cameras {
        let id = u32::from_le_bytes(bytes(file)?);
        let told = |reason: String| format!("camera {id}: {reason}");
        let number = u32::from_le_bytes(bytes(file)?);
        let model = usize::try_from(number).ok().filter(|&model| model < MODELS.len());
        let model = model.ok_or_else(|| told(format!("{number} is no model of a lens")))?;
        let size = [u64::from_le_bytes(bytes(file)?), u64::from_le_bytes(bytes(file)?)];
        let mut parameters = Vec::new();
        for _ in 0..MODELS[model].1 {
            parameters.extend(floats::<1>(file)?);
        }
        let size = size.map(|side| side as f64);
        found.insert(id, intrinsics(model, size, &parameters).map_err(told)?);
    }
    Ok(found)
}

fn binary_images(file: &mut impl BufRead) -> Result<Vec<Pose>, String> {
    let images = count(u64::from_le_bytes(bytes(file)?), "images")?;
    let mut found = Vec::new();
    for _ in 0..images {
        let _id: [u8; 4] = bytes(file)?;
        let rotation = floats(file)?;
        let translation = floats(file)?;
        let camera = u32::from_le_bytes(bytes(file)?);
        let mut name = Vec::new();
        let read = file.by_ref().take(LONGEST).read_until(0, &mut name);
        if read.map_err(|error| error.to_string())? == 0 || name.pop() != Some(0) {
            return Err(format!("image {}: its name has no end", found.len()));
        }
        let points = u64::from_le_bytes(bytes(file)?).saturating_mul(POINT);
        let passed = std::io::copy(&mut file.by_ref().take(points), &mut std::io::sink());
        if passed.map_err(|error| error.to_string())? != points {
            return Err(format!("ends too early, in the points of image {}", found.len()));
        }
        found.push(Pose {
            rotation,
            translation,
            camera,
            name,
        });
    }
    Ok(found)
}

/// The next line that is no remark, and its number, from 1; none at the end.
fn line(file: &mut impl BufRead, number: &mut usize) -> Result<Option<String>, String> {
    loop {
        *number += 1;
        let mut line = Vec::new();
        let read = file.by_ref().take(LONGEST).read_until(b'\n', &mut line);
        if read.map_err(|error| error.to_string())? == 0 {
            return Ok(None);
        }
        if line.len() as u64 == LONGEST {
            return Err(format!("line {number} is longer than {LONGEST} bytes"));
        }
        let text = String::from_utf8_lossy(&line).trim().to_owned();
        if !text.is_empty() && !text.starts_with('#') {
            return Ok(Some(text));
        }
    }
}

fn numbers<const N: usize>(words: &[&str]) -> Option<[f64; N]> {
    let words: &[&str; N] = words.try_into().ok()?;
    let mut found = [0.0; N];
    for (value, word) in found.iter_mut().zip(words) {
        *value = word.parse().ok()?;
    }
    Some(found)
}

fn text_cameras(file: &mut impl BufRead) -> Result<HashMap<u32, Intrinsics>, String> {
    let (mut found, mut number) = (HashMap::new(), 0);
    while let Some(line) = line(file, &mut number)? {
        let told = |reason: &str| format!("line {number}: {reason}");
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let [id, model, width, height, parameters @ ..] = &words[..] else {
            return Err(told("is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS"));
        };
        let id = id.parse().map_err(|_| told("its camera has no number"))?;
        let model = MODELS.iter().position(|(name, ..)| name == model);
        let model = model.ok_or_else(|| told("has a lens that is not known"))?;
        let size = numbers(&[*width, *height]).ok_or_else(|| told("its size is none"))?;
        let parameters: Option<Vec<f64>> = parameters.iter().map(|word| word.parse().ok()).collect();
        let parameters = parameters.filter(|found| found.len() == MODELS[model].1);
        let wanted = format!("{} has {} numbers", MODELS[model].0, MODELS[model].1);
        let parameters = parameters.ok_or_else(|| told(&wanted))?;
        found.insert(
            id,
            intrinsics(model, size, &parameters).map_err(|reason| told(&reason))?,
        );
        count(found.len() as u64, "cameras")?;
    }
    Ok(found)
}

fn text_images(file: &mut impl BufRead) -> Result<Vec<Pose>, String> {
    let (mut found, mut number) = (Vec::new(), 0);
    while let Some(line) = line(file, &mut number)? {
        let told = |reason: &str| format!("line {number}: {reason}");
        // The name may have spaces in it.
        let mut rest = line.as_str();
        let mut words = Vec::new();
        for _ in 0..9 {
            let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            words.push(word);
            rest = after.trim_start();
        }
        let shape = "is not IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
        let camera = words[8].parse().map_err(|_| told(shape))?;
        found.push(Pose {
            rotation: numbers(&words[1..5]).ok_or_else(|| told(shape))?,
            translation: numbers(&words[5..8]).ok_or_else(|| told(shape))?,
            camera,
            name: rest.as_bytes().to_vec(),
        });
        count(found.len() as u64, "images")?;
        // Its points: a line that may be empty, and long.
        number += 1;
        file.skip_until(b'\n').map_err(|error| error.to_string())?;
    }
    Ok(found)
}

#[cfg(test)]
mod tests;
