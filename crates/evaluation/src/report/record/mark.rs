//! One embedding: what was asked for, and how it went.
use super::check::{amount, bad, finite, maybe, named, share};
use super::id::{Id, Identity};
use super::timing::Timing;
use crate::error::Result;
use serde::{Deserialize, Serialize};
use std::path::{Component, Path, PathBuf};

/// What identifies a mark: all that an embedding depends on but the machine.
///
/// Neither the experiment nor the device are part of it: an embedding that several experiments need is made once, and
/// a run may be resumed on another machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Embedding {
    /// Name of the scene, such as "lego".
    pub scene: String,
    /// Bits of the message, at least 1.
    pub bits: u32,
    /// Name of the variant of the settings, such as [`crate::report::names::STANDARD`].
    pub variant: String,
    /// Hash of these settings, without scene, bits and seeds; any text that changes when they do.
    pub settings_hash: String,
    /// Seed of the embedding.
    pub seed: u64,
    /// Seed of the key.
    pub key_seed: u64,
    /// The message, in hexadecimal, most significant bit first; `ceil(bits / 4)` digits or more.
    pub message: String,
    /// Name of the CLIP.
    pub clip: String,
    /// Hash of its weights.
    pub clip_hash: String,
    /// Version of the engine.
    pub engine_version: String,
    /// Side of the views in pixels.
    pub size: u32,
}

impl Embedding {
    /// Its identity, and that of the mark that comes of it.
    pub fn id(&self) -> Id {
        Identity::of("mark")
            .text(&self.scene)
            .number(self.bits.into())
            .text(&self.variant)
            .text(&self.settings_hash)
            .number(self.seed)
            .number(self.key_seed)
            .text(&self.message.to_ascii_lowercase())
            .text(&self.clip)
            .text(&self.clip_hash)
            .text(&self.engine_version)
            .number(self.size.into())
            .id()
    }

    fn check(&self) -> Result<()> {
        named("scene", &self.scene)?;
        named("variant", &self.variant)?;
        named("settings_hash", &self.settings_hash)?;
        named("clip_hash", &self.clip_hash)?;
        named("engine_version", &self.engine_version)?;
        if self.bits == 0 {
            return bad("bits", "0 are no message");
        }
        if self.size == 0 {
            return bad("size", "views of 0 pixels");
        }
        let digits = self.message.len() as u64;
        if !self.message.bytes().all(|digit| digit.is_ascii_hexdigit()) || 4 * digits < self.bits.into() {
            return bad(
                "message",
                format!("{digits} characters are not {} bits in hexadecimal", self.bits),
            );
        }
        Ok(())
    }
}

/// One embedding, and how it went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// What was asked for.
    pub embedding: Embedding,
    /// The experiment that it was made for first, such as "capacity".
    pub experiment: String,
    /// Gaussians of the scene.
    pub gaussians: u64,
    /// Where it ran, such as the name of the graphics card.
    pub device: String,
    /// PSNR of held-out views against the unmarked scene in dB, mean over views; `None` if they are identical.
    #[serde(deserialize_with = "present")]
    pub psnr_db: Option<f64>,
    /// SSIM of the same views, -1..=1.
    pub ssim: f64,
    /// LPIPS (AlexNet, v0.1) of the same views, if it was measured.
    pub lpips: Option<f64>,
    /// Wall time of the embedding in seconds, without making the key.
    pub seconds: f64,
    /// Wall time of making the key in seconds, if it was made for this mark.
    pub key_seconds: Option<f64>,
    /// Steps of the optimiser.
    pub steps: u64,
    /// Views rendered in them.
    pub view_steps: u64,
    /// Views rendered until the first check at which held-out accuracy was at least 99 %, if there was one.
    pub view_steps_to_99: Option<u64>,
    /// Bit accuracy of the key's decoder on texts it was not trained on, 0..=1, if it was measured.
    pub decoder_accuracy: Option<f64>,
    /// Most memory in use at once, in bytes, if it was measured.
    pub peak_memory_bytes: Option<u64>,
    /// Bit accuracy of views of the unmarked scene against the message, 0..=1, if it was measured.
    pub unmarked_accuracy: Option<f64>,
    /// A PNG that shows what the mark changed; relative to the folder of the store.
    pub difference_picture: Option<PathBuf>,
    /// Where and when the seconds were measured, if that was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timing: Option<Timing>,
}

impl Mark {
    /// Its identity.
    pub fn id(&self) -> Id {
        self.embedding.id()
    }

    pub(super) fn check(&self) -> Result<()> {
        self.embedding.check()?;
        named("experiment", &self.experiment)?;
        maybe("psnr_db", self.psnr_db, finite)?;
        if !(-1.0..=1.0).contains(&self.ssim) {
            return bad("ssim", format!("{} is not within -1..=1", self.ssim));
        }
        maybe("lpips", self.lpips, amount)?;
        amount("seconds", self.seconds)?;
        maybe("key_seconds", self.key_seconds, amount)?;
        maybe("decoder_accuracy", self.decoder_accuracy, share)?;
        maybe("unmarked_accuracy", self.unmarked_accuracy, share)?;
        if let Some(timing) = &self.timing {
            timing.check()?;
        }
        if let Some(path) = &self.difference_picture
            && !is_inside(path)
        {
            return bad(
                "difference_picture",
                format!("{} is not a path inside the store", path.display()),
            );
        }
        Ok(())
    }
}

/// Whether a relative path cannot lead out of the folder it starts in; a report must not publish other files.
fn is_inside(path: &Path) -> bool {
    let mut parts = path.components().peekable();
    parts.peek().is_some() && parts.all(|part| matches!(part, Component::Normal(_)))
}

/// Reads what may be null, but not missing: a lost PSNR must not pass for identical views.
fn present<'de, D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Option<f64>, D::Error> {
    Option::deserialize(deserializer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{Change, mark};

    #[test]
    fn results_experiment_and_device_do_not_identify() {
        let first = mark("lego", 16, "standard", 1);
        let mut other = first.clone();
        other.experiment = "robustness".into();
        other.device = "another".into();
        other.psnr_db = None;
        other.seconds = 1.0;
        assert_eq!(first.id(), other.id());
    }

    #[test]
    fn everything_asked_for_identifies() {
        let first = mark("lego", 16, "standard", 1).embedding;
        let changes: [fn(&mut Embedding); 11] = [
            |e| e.scene.push('x'),
            |e| e.bits += 1,
            |e| e.variant.push('x'),
            |e| e.settings_hash.push('x'),
            |e| e.seed += 1,
            |e| e.key_seed += 1,
            |e| e.message.push('0'),
            |e| e.clip.push('x'),
            |e| e.clip_hash.push('x'),
            |e| e.engine_version.push('x'),
            |e| e.size += 1,
        ];
        let mut ids = vec![first.id()];
        for change in changes {
            let mut other = first.clone();
            change(&mut other);
            ids.push(other.id());
        }
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), 12);
    }

    #[test]
    fn impossible_marks_are_refused() {
        mark("lego", 16, "standard", 1).check().unwrap();
        let changes: [Change<Mark>; 9] = [
            ("psnr_db", |m| m.psnr_db = Some(f64::INFINITY)),
            ("ssim", |m| m.ssim = f64::NAN),
            ("lpips", |m| m.lpips = Some(-0.1)),
            ("unmarked_accuracy", |m| m.unmarked_accuracy = Some(53.0)),
            ("message", |m| m.embedding.message = "fff".into()),
            ("message", |m| m.embedding.message = "xyzw".into()),
            ("scene", |m| m.embedding.scene = " ".into()),
            ("difference_picture", |m| {
                m.difference_picture = Some("../secret.png".into());
            }),
            ("difference_picture", |m| {
                m.difference_picture = Some("/etc/x.png".into())
            }),
        ];
        for (field, change) in changes {
            let mut broken = mark("lego", 16, "standard", 1);
            change(&mut broken);
            let reason = broken.check().unwrap_err().to_string();
            assert!(reason.starts_with(field), "{field}: {reason}");
        }
    }

    #[test]
    fn a_missing_psnr_is_not_identical_views() {
        let mut value = serde_json::to_value(mark("lego", 16, "standard", 1)).unwrap();
        value["psnr_db"] = serde_json::Value::Null;
        let identical: Mark = serde_json::from_value(value.clone()).unwrap();
        assert_eq!(identical.psnr_db, None);
        value.as_object_mut().unwrap().remove("psnr_db");
        assert!(serde_json::from_value::<Mark>(value).is_err());
    }
}
