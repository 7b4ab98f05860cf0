//! The engine for Python: what `python/guardsplat` is made of. Arrays cross as bytes, reports as JSON; how they look to
//! users is decided there.
// `cargo test --lib` links this as a program, for which Python's symbols are missing; pytest tests it.
#![cfg(not(test))]
mod cameras;
mod embed;
mod errors;
mod gaussians;
mod job;
mod key;
mod scenes;
mod verify;

/// The native half of the package `guardsplat`.
#[pyo3::pymodule]
mod _engine {
    #[pymodule_export]
    use super::cameras::{read_cameras, write_cameras};
    #[pymodule_export]
    use super::embed::{embed, embed_gaussians};
    #[pymodule_export]
    use super::gaussians::{load_gaussians, save_gaussians};
    #[pymodule_export]
    use super::key::Key;
    #[pymodule_export]
    use super::scenes::{inspect, render, render_gaussians, sample};
    #[pymodule_export]
    use super::verify::verify;

    /// Version of the package.
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
