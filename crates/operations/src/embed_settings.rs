//! The settings of an embedding from what users choose.
use guardsplat_engine::Result;
use guardsplat_engine::embed::Settings;

/// `base` with a seed, and a size of the training views that the verification's follow.
pub fn chosen(base: Settings, seed: u64, size: Option<u32>) -> Result<Settings> {
    let mut settings = Settings { seed, ..base };
    if let Some(size) = size {
        settings.size = size;
        settings.verify.size = Some(size);
    }
    settings.check()?;
    Ok(settings)
}
