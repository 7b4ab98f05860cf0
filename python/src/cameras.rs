//! Cameras: of files, or as numbers.
use std::path::PathBuf;

use guardsplat_engine::Result;
use guardsplat_engine::view::Camera;
use guardsplat_operations::load;
use pyo3::prelude::*;

use crate::errors::exception;

/// Width and height; fx, fy, cx, cy; world to camera: rotation, by rows, and translation.
pub type Numbers = (u32, u32, [f32; 4], [[f32; 3]; 3], [f32; 3]);

/// Where cameras come from.
#[derive(FromPyObject)]
pub enum Cameras {
    /// A file, or a folder of COLMAP.
    File(PathBuf),
    /// These.
    Given(Vec<Numbers>),
}

impl Cameras {
    /// The cameras; none where none are wanted.
    pub fn of(chosen: Option<Self>) -> Result<Vec<Camera>> {
        match chosen {
            None => Ok(Vec::new()),
            Some(Self::File(path)) => load::cameras(Some(&path)),
            Some(Self::Given(given)) => Ok(given.into_iter().map(camera).collect()),
        }
    }
}

fn camera((width, height, [fx, fy, cx, cy], rotation, translation): Numbers) -> Camera {
    Camera {
        width,
        height,
        fx,
        fy,
        cx,
        cy,
        rotation,
        translation,
    }
}

/// A camera as numbers.
pub fn numbers(camera: &Camera) -> Numbers {
    let Camera { fx, fy, cx, cy, .. } = *camera;
    let (rotation, translation) = (camera.rotation, camera.translation);
    (camera.width, camera.height, [fx, fy, cx, cy], rotation, translation)
}

/// Cameras of a file (cameras.json, transforms.json or a glTF), or of a folder of COLMAP.
#[pyfunction]
pub fn read_cameras(py: Python<'_>, path: PathBuf) -> PyResult<Vec<Numbers>> {
    let read = py.detach(|| guardsplat_engine::view::read_cameras(&path));
    let cameras = read.map_err(|error| exception(py, &error))?;
    Ok(cameras.iter().map(numbers).collect())
}

/// Writes cameras.json, or transforms.json where the name says so.
#[pyfunction]
pub fn write_cameras(py: Python<'_>, path: PathBuf, cameras: Vec<Numbers>) -> PyResult<()> {
    let cameras: Vec<Camera> = cameras.into_iter().map(camera).collect();
    let written = py.detach(|| guardsplat_engine::view::write_cameras(&path, &cameras));
    written.map_err(|error| exception(py, &error))
}
