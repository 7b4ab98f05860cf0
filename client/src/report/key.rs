//! Keys, and how they came out.
use guardsplat_proto::v1::{Key, KeyResult};
use serde::Serialize;

use super::text::{seconds, some, time};

/// What is known of a key.
#[derive(Debug, Serialize)]
pub struct KeyReport {
    name: String,
    display_name: String,
    bits: u32,
    clip: String,
    clip_sha256: String,
    seeded: bool,
    create_time: Option<String>,
    job: Option<String>,
}

impl From<&Key> for KeyReport {
    fn from(key: &Key) -> Self {
        Self {
            name: key.name.clone(),
            display_name: key.display_name.clone(),
            bits: key.bits,
            clip: key.clip.clone(),
            clip_sha256: key.clip_sha256.clone(),
            seeded: key.seeded,
            create_time: time(key.create_time),
            job: some(&key.job),
        }
    }
}

/// What came of a job that made a key.
#[derive(Debug, Serialize)]
pub struct KeyResultReport {
    key: String,
    bit_accuracy_unseen: Option<f64>,
    bit_accuracy_unseen_noisy: Option<f64>,
    device: String,
    seconds: f64,
}

impl From<&KeyResult> for KeyResultReport {
    fn from(result: &KeyResult) -> Self {
        Self {
            key: result.key.clone(),
            bit_accuracy_unseen: result.bit_accuracy_unseen,
            bit_accuracy_unseen_noisy: result.bit_accuracy_unseen_noisy,
            device: result.device.clone(),
            seconds: seconds(result.duration),
        }
    }
}

impl KeyResultReport {
    /// For people.
    pub fn line(&self) -> String {
        let unseen = self
            .bit_accuracy_unseen
            .map_or("unknown".into(), |a| format!("{:.2} %", 100.0 * a));
        format!(
            "{}; bits of unseen messages read from their texts: {unseen} ({:.0} s)",
            self.key, self.seconds
        )
    }
}
