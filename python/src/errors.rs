//! Errors of the engine as exceptions of `guardsplat.errors`, with what they name.
use std::path::Path;

use guardsplat_engine::Error;
use guardsplat_operations::error_text::in_full;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The exception for `error`.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let (class, field, path): (_, Option<&str>, Option<&Path>) = match error {
        Error::Io { path, .. } => ("FileError", None, Some(path)),
        Error::BadScene { path, .. } => ("BadScene", None, Some(path)),
        Error::BadCameras { path, .. } => ("BadCameras", None, Some(path)),
        Error::BadPicture { path, .. } => ("BadPicture", None, Some(path)),
        Error::BadKey { path, .. } => ("BadKey", None, Some(path)),
        Error::BadModel { .. } => ("BadModel", None, None),
        Error::BadOption { field, .. } => ("BadOption", Some(*field), None),
        Error::DoesNotFit { .. } => ("DoesNotFit", None, None),
        Error::Device { .. } => ("DeviceError", Some("device"), None),
        Error::NotFinite { term, .. } => ("NotFinite", Some(*term), None),
        Error::Stopped => ("Stopped", None, None),
        _ => ("GuardSplatError", None, None),
    };
    let code = match error {
        Error::Io { source, .. } => source.raw_os_error(),
        _ => None,
    };
    made(py, class, &in_full(error), field, path, code).unwrap_or_else(|failure| failure)
}

/// The exception of an option that is not what it may be.
pub fn bad_option(py: Python<'_>, field: &'static str, reason: String) -> PyErr {
    exception(py, &Error::BadOption { field, reason })
}

/// The exception of a value of Python that could not be turned into what the engine takes.
pub fn failure(what: &str) -> PyErr {
    PyRuntimeError::new_err(what.to_owned())
}

fn made(
    py: Python<'_>,
    class: &str,
    text: &str,
    field: Option<&str>,
    path: Option<&Path>,
    code: Option<i32>,
) -> PyResult<PyErr> {
    let arguments = PyDict::new(py);
    arguments.set_item("field", field.map(argument))?;
    arguments.set_item("path", path)?;
    if class == "FileError" {
        arguments.set_item("errno", code)?;
    }
    let class = py.import("guardsplat.errors")?.getattr(class)?;
    Ok(PyErr::from_value(class.call((text,), Some(&arguments))?))
}

/// What Python calls an option of the programs.
fn argument(field: &str) -> String {
    match field {
        "OUT" => "path_out".into(),
        "PATH" => "suspects".into(),
        other => other.trim_start_matches("--").replace('-', "_"),
    }
}
