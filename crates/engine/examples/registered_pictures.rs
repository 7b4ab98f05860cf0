//! From where pictures were taken as it is found with the unmarked original, and how many bits are right then, and by the matched filter
//! of each picture and of all, as CSV:
//! `cargo run --release --example registered_pictures -- KEY MESSAGE ORIGINAL SEED PICTURE...`. Pictures are those of
//! `guardsplat-worker render MARKED FOLDER --seed SEED`, changed in any way that leaves things where they are, with the number
//! of the view last in their names. An error is the median distance of Gaussians' centres from where they are in the true
//! view, hidden ones included, for a picture of 800 pixels.
use std::path::Path;
use std::time::Instant;

use guardsplat_codeword::{Message, Reading, RegisteredTones};
use guardsplat_engine::clip::{Parts, ShippedClip};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::extract::{Engine, Original, PooledLogits, RegisteredPicture, read_given};
use guardsplat_engine::message::Key;
use guardsplat_engine::quality::read_picture;
use guardsplat_engine::scene::{Gaussians, Scene};
use guardsplat_engine::view::{Camera, Split, ViewSampler};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Every so many Gaussians are looked at.
const EVERY: usize = 7;

fn percent(logits: &[f32], message: &Message) -> Result<f64> {
    Ok(100.0 * Reading::from_logits(logits)?.bit_accuracy(message)?)
}

fn error(gaussians: &Gaussians, truth: &Camera, found: &Camera) -> f32 {
    // Shares of the sides: the two are of pictures of different sizes.
    let place = |camera: &Camera, point: [f32; 3]| {
        let [x, y] = camera.pixel(point);
        [x / camera.width as f32, y / camera.height as f32]
    };
    let distance = |point: &[f32; 3]| {
        let ([x, y], [u, v]) = (place(truth, *point), place(found, *point));
        let inside = [x, y].iter().all(|v| (0.0..1.0).contains(v));
        inside.then(|| 800.0 * ((x - u).powi(2) + (y - v).powi(2)).sqrt())
    };
    let mut distances: Vec<f32> = gaussians.positions.iter().step_by(EVERY).filter_map(distance).collect();
    distances.sort_by(f32::total_cmp);
    distances.get(distances.len() / 2).copied().unwrap_or(f32::NAN)
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let mut next = |what: &str| arguments.next().ok_or(format!("give {what}"));
    let key = Key::read(next("a key")?.as_ref())?;
    let message = key.message(&next("a message")?)?;
    let gaussians = Scene::read(next("an original")?.as_ref())?.into_gaussians();
    let seed: u64 = next("a seed")?.parse()?;
    let compute = open(DeviceChoice::Cpu)?;
    let shipped = ShippedClip::named(&key.clip.name).ok_or("the key is not of a CLIP of this repository")?;
    let clip = shipped.load(&compute.device, Parts::Image)?;
    let engine = Engine::new(compute, clip, &key, None)?;
    let rendered_from = ViewSampler::new(&gaussians, seed)?;
    let original = Original::new(&engine, &gaussians, ViewSampler::new(&gaussians, 0)?);
    println!("picture,as_given_percent,explained,error_px,compared_percent,fitted_percent,matched_percent,seconds");
    let mut kept = Vec::new();
    for file in arguments {
        let start = Instant::now();
        let picture = read_picture(file.as_ref(), [1.0; 3])?;
        let name = Path::new(&file)
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let digits = name.rsplit(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
        let truth = rendered_from.camera(Split::HeldOut, digits.parse()?, 800);
        let given = percent(&read_given(&engine, &picture)?, &message)?;
        let Some(found) = original.register(&picture)? else {
            println!("{file},{given:.1},,,,,,{:.1}", start.elapsed().as_secs_f32());
            continue;
        };
        let mut read = Vec::new();
        for tones in RegisteredTones::ALL {
            read.push(percent(&original.read(&picture, &found, tones)?, &message)?);
        }
        let small = RegisteredPicture::of(&picture, &found)?;
        let matched = original.read_matched(std::slice::from_ref(&small))?;
        let matched = matched.map_or(Ok(f64::NAN), |logits| percent(&logits[0], &message))?;
        kept.push(small);
        println!(
            "{file},{given:.1},{:.3},{:.2},{:.1},{:.1},{matched:.1},{:.1}",
            found.explained,
            error(&gaussians, &truth, &found.camera),
            read[0],
            read[1],
            start.elapsed().as_secs_f32()
        );
    }
    let together = original.read_matched(&kept)?.map(PooledLogits::new).transpose()?;
    if let Some(together) = together {
        println!("together,,,,,,{:.1},", percent(&together.summed, &message)?);
    }
    Ok(())
}
