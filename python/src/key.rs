//! Keys.
use std::path::PathBuf;
use std::sync::Arc;

use guardsplat_distortion::RobustTo;
use guardsplat_engine::clip::ShippedClip;
use guardsplat_engine::message::key::KeyProgress;
use guardsplat_engine::message::training::Progress as Training;
use guardsplat_engine::message::{Key as EngineKey, KeyOptions, TrainingOptions};
use guardsplat_operations::create_key::{ProjectionOverrides, create};
use guardsplat_operations::load;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::exception;
use crate::job::{Context, run};

/// A secret that messages are written and read with.
///
/// Whoever has it can read, forge and remove its marks. Make one with `Key.create`, keep it with `save`, and read it
/// with `load`.
#[pyclass(frozen, module = "guardsplat")]
pub struct Key {
    /// What the engine knows.
    pub inner: Arc<EngineKey>,
    /// Where it came from, for messages.
    pub path: PathBuf,
}

/// Tells of a key's making as jobs of a server do.
fn tell(context: &Context, progress: KeyProgress) {
    match progress {
        KeyProgress::Pictures(done, total) => context.at("preparing", done, total),
        KeyProgress::Decoder(Training::Encoding(done, total) | Training::Training(done, total)) => {
            context.at("optimising", done, total);
        }
    }
}

#[pymethods]
impl Key {
    /// Makes a key for messages of so many bits, 1 to 150.
    ///
    /// Without a seed it is random. With one it can be made again, and is no more secret than the seed.
    /// `clip` names a CLIP, shipped or added by `guardsplat-worker models add`, instead of the newest shipped one.
    #[staticmethod]
    #[pyo3(signature = (bits=32, seed=None, *, clip=None, device="auto", progress=None))]
    fn create(
        py: Python<'_>,
        bits: usize,
        seed: Option<u64>,
        clip: Option<&str>,
        device: &str,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let options = KeyOptions {
            bits,
            coded: true,
            bits_per_token: None,
            seed,
            robust_to: RobustTo::none(),
            training: TrainingOptions::default(),
        };
        let device = device.parse().map_err(|error| exception(py, &error))?;
        let made = run(py, progress, |context| {
            let compute = load::device(device, clip.unwrap_or(ShippedClip::NEWEST), load::Work::Reading)?;
            let overrides = ProjectionOverrides::default();
            create(&options, overrides, clip, &compute, &context.stop, |progress| {
                tell(context, progress);
            })
        })?;
        Ok(Self {
            path: made.id().into(),
            inner: Arc::new(made),
        })
    }

    /// Reads a key file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = py.detach(|| EngineKey::read(&path));
        let inner = Arc::new(read.map_err(|error| exception(py, &error))?);
        Ok(Self { inner, path })
    }

    /// A key from the bytes of its file.
    #[staticmethod]
    fn from_bytes(py: Python<'_>, data: &[u8]) -> PyResult<Self> {
        let read = EngineKey::from_bytes("bytes", data).map_err(|error| exception(py, &error))?;
        Ok(Self {
            path: read.id().into(),
            inner: Arc::new(read),
        })
    }

    /// Writes the key file, readable by its owner only; a file that is there is replaced.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.inner.write(&path))
            .map_err(|error| exception(py, &error))
    }

    /// The bytes of the key file. They hold the secret.
    fn to_bytes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        let bytes = self.inner.to_bytes().map_err(|error| exception(py, &error))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// 32 hexadecimal digits that name the key and give nothing of the secret away.
    #[getter]
    fn id(&self) -> String {
        self.inner.id()
    }

    /// Bits of its messages.
    #[getter]
    fn bits(&self) -> usize {
        self.inner.bits()
    }

    /// The CLIP that it reads with.
    #[getter]
    fn clip(&self) -> &str {
        &self.inner.clip.name
    }

    /// Share of bits that its decoder reads right of messages it was not made with, where that was measured.
    #[getter]
    fn bit_accuracy_unseen(&self) -> Option<f64> {
        self.inner.accuracy_unseen
    }

    fn __repr__(&self) -> String {
        format!("<Key {} of {} bits>", self.inner.id(), self.inner.bits())
    }
}
