//! A cache of the engine's thread: the device, and the engine of the key that was used last.
use std::path::Path;

use guardsplat_engine::Result;
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::stop::Stop;

use guardsplat_operations::load;

/// A device, and the engine of the last key on it.
pub struct EngineCache {
    compute: Compute,
    /// Bytes of memory that a job may take, if not all of the machine's.
    budget: Option<u64>,
    /// The key's id, and its engine.
    loaded: Option<(String, Engine)>,
}

impl EngineCache {
    /// Opens the device, for jobs that may take so many bytes of memory.
    pub fn open(device: DeviceChoice, budget: Option<u64>) -> Result<Self> {
        Ok(Self {
            compute: open(device)?,
            budget,
            loaded: None,
        })
    }

    /// The device's name.
    pub fn device(&self) -> &str {
        &self.compute.name
    }

    /// The device.
    pub fn compute(&self) -> &Compute {
        &self.compute
    }

    /// The engine for `key`, the one from before if it is the same key's; it heeds `stop`, and judges at a rate of false
    /// positives. `name` is the key's, for messages.
    pub fn engine(&mut self, name: &str, key: &Key, false_positive_rate: f64, stop: &Stop) -> Result<&Engine> {
        stop.check()?;
        let id = key.id();
        let kept = self.loaded.take().filter(|(loaded, _)| *loaded == id);
        let engine = match kept {
            Some((_, engine)) => engine,
            None => load::engine(Path::new(name), key, None, self.compute.clone(), true, self.budget)?,
        };
        let (_, engine) = self.loaded.insert((id, engine));
        engine.stop = stop.clone();
        engine.false_positive_rate = false_positive_rate;
        Ok(engine)
    }
}
