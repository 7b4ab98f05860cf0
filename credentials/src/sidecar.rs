//! A sidecar: its bytes within a limit, and what its active manifest says.
use std::io::Read as _;
use std::path::Path;

use c2pa::assertions::SoftBinding;
use c2pa::{Context, Manifest, Reader, Settings};
use guardsplat_soft_binding::{ALGORITHM, Value};

use crate::error::{Error, Result};

/// Most bytes of a sidecar. Ours have a few thousand; those of scenes that were edited many times have more.
const MAX_BYTES: u64 = 16 << 20;

/// Reads a sidecar.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    file.take(MAX_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(Error::io(path))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::file(
            path,
            format!("it has more than {MAX_BYTES} bytes, the most that is read"),
        ));
    }
    Ok(bytes)
}

/// What reads manifests: nothing is fetched, and `anchors` (PEM) are all that is trusted.
pub fn reader(anchors: Option<String>) -> Result<Reader, c2pa::Error> {
    let settings = Settings::new()
        .with_value("verify.remote_manifest_fetch", false)?
        .with_value("verify.ocsp_fetch", false)?;
    let settings = match anchors {
        Some(anchors) => settings.with_value("trust.user_anchors", anchors)?,
        None => settings,
    };
    Ok(Reader::from_context(Context::new().with_settings(settings)?))
}

/// The marks of ours that a manifest names.
pub fn marks(manifest: &Manifest) -> Vec<Value> {
    let ours = manifest
        .assertions()
        .iter()
        .filter(|assertion| assertion.label().starts_with(SoftBinding::LABEL))
        .filter_map(|assertion| assertion.to_assertion::<SoftBinding>().ok())
        .filter(|binding| binding.alg.as_deref() == Some(ALGORITHM));
    let values = ours
        .flat_map(|binding| binding.blocks)
        .map(|block| Value::parse(&block.value));
    values.filter_map(Result::ok).collect()
}
