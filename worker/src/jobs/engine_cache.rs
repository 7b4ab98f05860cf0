//! A cache of the engine's thread: the engine of the key that was used last, on the device that suits its CLIP.
use std::path::Path;

use guardsplat_engine::Result;
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::stop::Stop;

use guardsplat_operations::load;

/// A choice of device, and the engine of the last key.
pub struct EngineCache {
    choice: DeviceChoice,
    /// What is opened where nothing is known of a CLIP.
    device: String,
    /// Bytes of memory that a job may take, if not all of the machine's.
    budget: Option<u64>,
    /// The key's id, and its engine.
    loaded: Option<(String, Engine)>,
}

impl EngineCache {
    /// Opens the device, for jobs that may take so many bytes of memory.
    pub fn open(device: DeviceChoice, budget: Option<u64>) -> Result<Self> {
        Ok(Self {
            choice: device,
            device: open(device)?.name,
            budget,
            loaded: None,
        })
    }

    /// The name of the device, of the card if `auto` found one; jobs with shipped CLIPs run beside it on the CPU.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// The device for the CLIP of that name.
    pub fn compute(&self, clip: &str) -> Result<Compute> {
        load::device(self.choice, clip)
    }

    /// The engine for `key`, the one from before if it is the same key's; it heeds `stop`, and judges at a rate of false
    /// positives. `name` is the key's, for messages.
    pub fn engine(&mut self, name: &str, key: &Key, false_positive_rate: f64, stop: &Stop) -> Result<&Engine> {
        stop.check()?;
        let id = key.id();
        let kept = self.loaded.take().filter(|(loaded, _)| *loaded == id);
        let engine = match kept {
            Some((_, engine)) => engine,
            None => load::engine(Path::new(name), key, None, self.choice, true, self.budget)?,
        };
        let (_, engine) = self.loaded.insert((id, engine));
        engine.stop = stop.clone();
        engine.false_positive_rate = false_positive_rate;
        Ok(engine)
    }
}
