//! The worker's capabilities: its device, memory and CLIPs, by which the server chooses jobs for it.
use std::time::Duration;

use guardsplat_engine::clip::ShippedClip;
use guardsplat_engine::memory::Limits;
use guardsplat_engine::models::{LPIPS, Models, WEIGHTS};
use guardsplat_proto::v1::LeaseJobRequest;

use super::convert;

/// Most characters of a device's name in the API.
const DEVICE_CHARACTERS: usize = 63;
/// Most CLIPs that the API takes.
const MOST_CLIPS: usize = 64;

/// What a worker can carry out.
#[derive(Clone, Debug)]
pub struct WorkerCapabilities {
    /// What it calls itself.
    pub name: String,
    device: String,
    memory: u64,
    shipped: Option<Vec<String>>,
}

impl WorkerCapabilities {
    /// A worker called `name` on `device`, whose jobs may take `budget` bytes of memory, or all that the machine has.
    pub fn new(name: String, device: &str, budget: Option<u64>) -> Self {
        // Without a shipped CLIP it is told when a job needs it, and to whoever made the job.
        let shipped = ShippedClip::ALL
            .iter()
            .map(ShippedClip::hash)
            .collect::<Result<_, _>>()
            .ok();
        Self {
            name,
            device: device
                .chars()
                .filter(|c| !c.is_control())
                .take(DEVICE_CHARACTERS)
                .collect(),
            memory: Limits::of_machine(budget).memory,
            shipped,
        }
    }

    /// Asks for a job that fits. Models may have been added since the last time.
    pub fn request(&self, wait: Duration) -> LeaseJobRequest {
        LeaseJobRequest {
            worker: self.name.clone(),
            wait: convert::duration(wait),
            device: self.device.clone(),
            memory_bytes: self.memory,
            clip_sha256: self.clips(),
            version: env!("CARGO_PKG_VERSION").into(),
        }
    }

    /// CLIPs that can be loaded; none where that can't be told, which stands for any.
    fn clips(&self) -> Vec<String> {
        let Some(shipped) = self.shipped.clone() else {
            return Vec::new();
        };
        // Without a data folder nothing was added.
        let added = Models::open().and_then(|models| models.list()).unwrap_or_default();
        let added = added.into_iter().filter(|entry| entry.name != LPIPS);
        let hashes = added
            .filter_map(|mut entry| entry.files.remove(WEIGHTS))
            .map(|file| file.sha256);
        shipped.into_iter().chain(hashes).take(MOST_CLIPS).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offer_says_what_the_server_takes() {
        let capabilities = WorkerCapabilities::new("w".into(), &"é".repeat(100), Some(5 << 20));
        let request = capabilities.request(Duration::from_secs(1));
        assert_eq!(request.device.chars().count(), DEVICE_CHARACTERS);
        assert_eq!(request.memory_bytes, 5 << 20);
        assert!(!request.clip_sha256.is_empty());
        for hash in request.clip_sha256 {
            assert!(hash.len() == 64 && hash.bytes().all(|b| b.is_ascii_hexdigit() && !b.is_ascii_uppercase()));
        }
    }
}
