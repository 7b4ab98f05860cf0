//! What can be expected of marking a scene, and what would help where that is too little.
use std::path::PathBuf;
use std::sync::Arc;

use guardsplat_codeword::Message;
use guardsplat_distortion::RobustTo;
use guardsplat_engine::clip::ShippedClip;
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::embed::{Forecast, Preset, forecast};
use guardsplat_engine::message::{Key, KeyOptions, TrainingOptions};
use guardsplat_engine::scene::Scene;
use guardsplat_engine::stop::Stop;
use guardsplat_engine::view::{Camera, SceneKind};
use guardsplat_engine::{Error, Result};
use serde::Serialize;

use crate::embed_settings::Choices;
use crate::{create_key, load};

/// Messages of so many bits are those that hard scenes hold.
const SHORT: usize = 16;
/// Of the keys that are made for a forecast alone.
const SEED: u64 = 0;

/// What is to be forecast.
#[derive(Clone, Debug)]
pub struct Wish {
    /// What names the key in messages, and the key; without one a key of [`Wish::bits`] is made, and forgotten.
    pub key: Option<(PathBuf, Arc<Key>)>,
    /// Bits of the message, where no key says them.
    pub bits: usize,
    /// The message, in hexadecimal: which bits a scene reads by itself decides where marks are hard. Any other without one.
    pub message: Option<String>,
    /// The preset.
    pub preset: Preset,
    /// Where to compute.
    pub device: DeviceChoice,
    /// Asks it to end early.
    pub stop: Stop,
}

/// A forecast, and how it would be with less to hide.
#[derive(Clone, Debug, Serialize)]
pub struct Told {
    /// The preset.
    pub preset: &'static str,
    /// Bits of the message.
    pub bits: usize,
    /// The key's CLIP.
    pub clip: String,
    /// What to expect.
    #[serde(flatten)]
    pub forecast: Forecast,
    /// Whether a mark is expected to reach its target and be written.
    pub meets_target: bool,
    /// The same with a key of 16 bits, where a longer message is expected to miss.
    pub shorter: Option<Box<Told>>,
}

/// Forecasts a mark of `scene`, whose viewers are at `cameras` or where those of such a `kind` are; within so many bytes of
/// `memory`, if not all of the machine's.
///
/// # Errors
/// Those of loading a key, a message that does not fit the key, and those of [`forecast`].
pub fn tell(
    scene: &Scene,
    wish: &Wish,
    cameras: &[Camera],
    kind: Option<SceneKind>,
    memory: Option<u64>,
) -> Result<Told> {
    let mut told = one(scene, wish, cameras, kind, memory)?;
    if !told.meets_target && told.bits > SHORT {
        let preset = match wish.preset {
            Preset::Standard => Preset::Robust,
            other => other,
        };
        let short = Wish {
            key: None,
            bits: SHORT,
            message: None,
            preset,
            ..wish.clone()
        };
        told.shorter = Some(Box::new(one(scene, &short, cameras, kind, memory)?));
    }
    Ok(told)
}

fn one(scene: &Scene, wish: &Wish, cameras: &[Camera], kind: Option<SceneKind>, memory: Option<u64>) -> Result<Told> {
    if wish.preset == Preset::Paper {
        return Err(Error::BadOption {
            field: "preset",
            reason: "marks of preset paper are not forecast, for nothing holds their PSNR".into(),
        });
    }
    let (path, key) = match &wish.key {
        Some((path, key)) => (path.clone(), key.clone()),
        None => {
            let options = KeyOptions {
                bits: wish.bits,
                coded: true,
                bits_per_token: None,
                seed: Some(SEED),
                robust_to: RobustTo::none(),
                training: TrainingOptions::default(),
            };
            let none = create_key::ProjectionOverrides::default();
            let compute = load::device(wish.device, ShippedClip::NEWEST, load::Work::Reading)?;
            let key = create_key::create(&options, none, None, &compute, &wish.stop, |_| {})?;
            (PathBuf::from("a key made for the forecast"), Arc::new(key))
        }
    };
    let bits = key.bits();
    let mut engine = load::engine(&path, &key, None, wish.device, load::Work::Marking, false, memory)?;
    engine.stop = wish.stop.clone();
    let settings = Choices {
        preset: wish.preset,
        kind,
        ..Choices::default()
    }
    .settings()?;
    let message = match &wish.message {
        Some(text) => key.message(text)?,
        None => any_message(bits)?,
    };
    let forecast = forecast(&engine, scene, &message, &settings, cameras, &mut |_| {})?;
    Ok(Told {
        preset: wish.preset.name(),
        bits,
        clip: key.clip.name.clone(),
        meets_target: forecast.meets_target(),
        forecast,
        shorter: None,
    })
}

/// A message like any other, about half of whose bits are set.
fn any_message(bits: usize) -> Result<Message> {
    // Multiples of the golden ratio spread evenly, and follow no pattern of bits.
    let bit = |i: u64| i.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 63 == 1;
    let bits: Vec<bool> = (1..=bits as u64).map(bit).collect();
    Ok(Message::from_bits(&bits)?)
}
