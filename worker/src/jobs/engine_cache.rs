//! A cache of the engine's thread: the engine of the key that was used last, on the device that suits its CLIP.
use std::path::Path;

use guardsplat_engine::Result;
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::stop::Stop;

use guardsplat_operations::load::{self, Work};

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

    /// The name of the device, of the card if `auto` found one; shipped CLIPs read beside it on the CPU.
    pub fn device(&self) -> &str {
        &self.device
    }

    /// The device for such work with the CLIP of that name.
    pub fn compute(&self, clip: &str, work: Work) -> Result<Compute> {
        load::device(self.choice, clip, work)
    }

    /// The engine for `key` and such work, the one from before if it is the same key's on the same device; it heeds `stop`, and
    /// judges at a rate of false positives. `name` is the key's, for messages.
    pub fn engine(
        &mut self,
        name: &str,
        key: &Key,
        work: Work,
        false_positive_rate: f64,
        stop: &Stop,
    ) -> Result<&Engine> {
        stop.check()?;
        let (id, device) = (key.id(), self.compute(&key.clip.name, work)?.name);
        let same = |(loaded, engine): &(String, Engine)| *loaded == id && engine.compute.name == device;
        let engine = match self.loaded.take().filter(same) {
            Some((_, engine)) => engine,
            None => load::engine(Path::new(name), key, None, self.choice, work, true, self.budget)?,
        };
        let (_, engine) = self.loaded.insert((id, engine));
        engine.stop = stop.clone();
        engine.false_positive_rate = false_positive_rate;
        Ok(engine)
    }
}
