//! Gaussians in memory, as gsplat has them: arrays of single precision, by rows, as bytes.
use std::path::PathBuf;

use guardsplat_engine::Result;
use guardsplat_engine::memory::{Limits, MemoryRequirements, admission};
use guardsplat_engine::scene::convert::convert_to;
use guardsplat_engine::scene::{BadRows, Format, Gaussians, Scene, Sh};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes};

use crate::job::run;

/// The arrays, whose shapes and values `guardsplat._splats` has checked.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Arrays<'py> {
    /// `[n, 3]`
    means: Bound<'py, PyBytes>,
    /// `[n, 4]`, w first
    quats: Bound<'py, PyBytes>,
    /// `[n, 3]`, logarithms
    scales: Bound<'py, PyBytes>,
    /// `[n]`, logits
    opacities: Bound<'py, PyBytes>,
    /// `[n, (degree + 1)^2, 3]`
    sh: Bound<'py, PyBytes>,
    degree: usize,
}

impl Arrays<'_> {
    /// The Gaussians, with the bands of spherical harmonics that are in use, as readers of files give them.
    pub fn gaussians(&self) -> Gaussians {
        let numbers = |bytes: &Bound<'_, PyBytes>| bytemuck::pod_collect_to_vec::<u8, f32>(bytes.as_bytes());
        let mut sh = Sh {
            degree: self.degree,
            coefficients: numbers(&self.sh),
        };
        sh.trim();
        Gaussians {
            positions: bytemuck::pod_collect_to_vec(self.means.as_bytes()),
            rotations: bytemuck::pod_collect_to_vec(self.quats.as_bytes()),
            log_scales: bytemuck::pod_collect_to_vec(self.scales.as_bytes()),
            opacity_logits: numbers(&self.opacities),
            sh,
        }
    }

    /// Colours of fewer bands with the room that the arrays have: `[n, (degree + 1)^2, 3]`.
    pub fn with_all_bands(&self, colours: &Sh) -> Vec<f32> {
        let room = Sh {
            degree: self.degree,
            coefficients: Vec::new(),
        };
        let (used, room) = (colours.per_gaussian(), room.per_gaussian());
        if used == room {
            return colours.coefficients.clone();
        }
        let mut all = Vec::with_capacity(colours.coefficients.len() / used * room);
        for row in colours.coefficients.chunks_exact(used) {
            all.extend_from_slice(row);
            all.resize(all.len() + room - used, 0.0);
        }
        all
    }
}

/// Numbers as an array that Python may change.
pub fn array<'py>(py: Python<'py>, numbers: &[f32]) -> Bound<'py, PyByteArray> {
    PyByteArray::new(py, bytemuck::cast_slice(numbers))
}

/// Means, quats, scales, opacities and spherical harmonics of a scene file, and their degree.
type Loaded<'py> = ([Bound<'py, PyByteArray>; 5], usize);

/// Reads a scene file into arrays.
#[pyfunction]
pub fn load_gaussians(
    py: Python<'_>,
    path: PathBuf,
    ignore_bad_rows: bool,
    memory: Option<u64>,
) -> PyResult<Loaded<'_>> {
    let read = |_: &_| -> Result<Gaussians> {
        let (limits, rest) = (Limits::of_machine(memory), MemoryRequirements::of_program());
        admission::admit_reading(&path, &limits, rest)?;
        let bad_rows = BadRows::ignored_if(ignore_bad_rows);
        Ok(Scene::read_with_files(&path, bad_rows, limits.left(&rest))?.into_gaussians())
    };
    let scene = run(py, None, read)?;
    let arrays = [
        array(py, scene.positions.as_flattened()),
        array(py, scene.rotations.as_flattened()),
        array(py, scene.log_scales.as_flattened()),
        array(py, &scene.opacity_logits),
        array(py, &scene.sh.coefficients),
    ];
    Ok((arrays, scene.sh.degree))
}

/// Writes arrays as a scene file, of the format that the name says, PLY where it says none.
#[pyfunction]
pub fn save_gaussians(py: Python<'_>, path: PathBuf, arrays: Arrays<'_>) -> PyResult<()> {
    let gaussians = arrays.gaussians();
    run(py, None, |_| {
        let format = Format::of_whole_name(&path).unwrap_or(Format::Ply);
        convert_to(&gaussians, format, &path)?;
        Ok(())
    })
}
