//! Looking at scenes: what is in them, pictures of them, and samples.
use std::path::PathBuf;

use guardsplat_engine::picture::Picture;
use guardsplat_engine::scene::BadRows;
use guardsplat_engine::stop::Stop;
use guardsplat_engine::view::{Camera, SceneKind};
use guardsplat_engine::{Error, Result};
use guardsplat_operations::forecast::Wish;
use guardsplat_operations::inspect::{self as inspection, Asked};
use guardsplat_operations::render::{self as rendering, Rendering};
use guardsplat_operations::sample::{self as samples, Sample};
use pyo3::prelude::*;
use pyo3::types::PyByteArray;

use crate::cameras::{Cameras, Numbers, numbers};
use crate::embed::json;
use crate::errors::{bad_option, exception};
use crate::gaussians::Arrays;
use crate::job::{Context, run};
use crate::key::Key;

/// What a scene file holds, as JSON.
#[pyfunction]
#[pyo3(signature = (path, views, cameras, kind, ignore_bad_rows, memory, forecast))]
pub fn inspect(
    py: Python<'_>,
    path: PathBuf,
    views: Option<u32>,
    cameras: Option<Cameras>,
    kind: Option<&str>,
    ignore_bad_rows: bool,
    memory: Option<u64>,
    forecast: Option<ForecastOptions>,
) -> PyResult<String> {
    let kind = kind_of(py, kind)?;
    let forecast = forecast.map(|options| options.wish(py)).transpose()?;
    run(py, None, |context| {
        let forecast = forecast.map(|wish| Wish {
            stop: context.stop.clone(),
            ..wish
        });
        let asked = Asked {
            views,
            cameras: Cameras::of(cameras)?,
            kind,
            level: 0,
            bad_rows: BadRows::ignored_if(ignore_bad_rows),
            memory,
            forecast,
        };
        json(&inspection::inspect(&path, &asked)?)
    })
}

/// What is to be forecast, as `guardsplat._scenes` has gathered it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct ForecastOptions {
    key: Option<Py<Key>>,
    bits: usize,
    message: Option<String>,
    preset: String,
    device: String,
}

impl ForecastOptions {
    fn wish(self, py: Python<'_>) -> PyResult<Wish> {
        let wrong = |error: Error| exception(py, &error);
        Ok(Wish {
            key: self.key.map(|key| {
                let key = key.get();
                (key.path.clone(), key.inner.clone())
            }),
            bits: self.bits,
            message: self.message,
            preset: self.preset.parse().map_err(wrong)?,
            device: self.device.parse().map_err(wrong)?,
            stop: Stop::default(),
        })
    }
}

/// What is to be rendered, as `guardsplat._scenes` has gathered it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    views: Option<u32>,
    cameras: Option<Cameras>,
    kind: Option<String>,
    size: Option<u32>,
    background: [f32; 3],
    seed: u64,
    ignore_bad_rows: bool,
    device: String,
    memory: Option<u64>,
    eight_bit: bool,
}

/// How pictures are handed over: of 8 bits, or as they are.
enum Pixels {
    EightBit(Vec<u8>),
    Float(Vec<f32>),
}

impl Pixels {
    fn of(picture: Picture, eight_bit: bool) -> Self {
        match eight_bit {
            true => Self::EightBit(
                (picture.pixels.iter())
                    .map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8)
                    .collect(),
            ),
            false => Self::Float(picture.pixels),
        }
    }

    fn bytes(&self) -> &[u8] {
        match self {
            Self::EightBit(bytes) => bytes,
            Self::Float(numbers) => bytemuck::cast_slice(numbers),
        }
    }
}

/// A picture's rows, top to bottom, and its camera.
type Rendered<'py> = (Bound<'py, PyByteArray>, Numbers);

impl Options {
    fn rendering(self, py: Python<'_>) -> PyResult<Rendering> {
        let wrong = |error: Error| exception(py, &error);
        let given = self.cameras.is_some();
        let cameras = py.detach(|| Cameras::of(self.cameras)).map_err(wrong)?;
        Ok(Rendering {
            views: self.views,
            cameras: given.then_some(cameras),
            kind: kind_of(py, self.kind.as_deref())?,
            size: self.size,
            background: self.background,
            seed: self.seed,
            level: 0,
            bad_rows: BadRows::ignored_if(self.ignore_bad_rows),
            device: self.device.parse().map_err(wrong)?,
            memory: self.memory,
        })
    }
}

/// Collects pictures, until an end is asked for.
fn collect(
    context: &Context,
    eight_bit: bool,
    pictures: &mut Vec<Pixels>,
) -> impl FnMut(usize, usize, &Camera, Picture) -> Result<()> {
    let stop: Stop = context.stop.clone();
    move |index, total, _, picture| {
        stop.check()?;
        pictures.push(Pixels::of(picture, eight_bit));
        context.at("rendering", index + 1, total);
        Ok(())
    }
}

fn handed_over<'py>(py: Python<'py>, pictures: &[Pixels], cameras: &[Camera]) -> Vec<Rendered<'py>> {
    let picture = |(pixels, camera): (&Pixels, &Camera)| (PyByteArray::new(py, pixels.bytes()), numbers(camera));
    pictures.iter().zip(cameras).map(picture).collect()
}

/// Pictures of a scene file, and their cameras.
#[pyfunction]
#[pyo3(signature = (path, options, progress))]
pub fn render<'py>(
    py: Python<'py>,
    path: PathBuf,
    options: Options,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Rendered<'py>>> {
    let eight_bit = options.eight_bit;
    let wanted = options.rendering(py)?;
    let (pictures, cameras) = run(py, progress, |context| {
        let mut pictures = Vec::new();
        let each = collect(context, eight_bit, &mut pictures);
        let (cameras, _) = rendering::render_file(&path, &wanted, each)?;
        Ok((pictures, cameras))
    })?;
    Ok(handed_over(py, &pictures, &cameras))
}

/// Pictures of Gaussians in memory, and their cameras.
#[pyfunction]
#[pyo3(signature = (arrays, options, progress))]
pub fn render_gaussians<'py>(
    py: Python<'py>,
    arrays: Arrays<'py>,
    options: Options,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Rendered<'py>>> {
    let eight_bit = options.eight_bit;
    let wanted = options.rendering(py)?;
    let gaussians = arrays.gaussians();
    let (pictures, cameras) = run(py, progress, |context| {
        let mut pictures = Vec::new();
        let each = collect(context, eight_bit, &mut pictures);
        let cameras = rendering::render(&gaussians, &wanted, each)?;
        Ok((pictures, cameras))
    })?;
    Ok(handed_over(py, &pictures, &cameras))
}

/// Writes a sample scene.
#[pyfunction]
#[pyo3(signature = (path, kind, gaussians, sh_degree, seed, cameras))]
pub fn sample(
    py: Python<'_>,
    path: PathBuf,
    kind: &str,
    gaussians: usize,
    sh_degree: usize,
    seed: u64,
    cameras: Option<PathBuf>,
) -> PyResult<()> {
    let wanted = Sample {
        kind: kind_of(py, Some(kind))?.unwrap_or(SceneKind::Object),
        gaussians,
        sh_degree,
        seed,
        cameras,
    };
    run(py, None, |_| samples::write(&path, &wanted))
}

fn kind_of(py: Python<'_>, kind: Option<&str>) -> PyResult<Option<SceneKind>> {
    let kind = kind.map(str::parse).transpose();
    kind.map_err(|reason| bad_option(py, "kind", reason))
}
