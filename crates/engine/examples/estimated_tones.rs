//! What is estimated to have been done to the tones of pictures, and how many bits are right then, as CSV:
//! `cargo run --release --example estimated_tones -- KEY MESSAGE FOLDER...`, each folder with pictures of one scene.
use guardsplat_codeword::{Message, Reading};
use guardsplat_engine::clip::{Parts, ShippedClip};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::extract::{Engine, PictureLogits, PooledLogits, estimates, find_source};
use guardsplat_engine::message::Key;
use guardsplat_engine::quality::read_picture;

/// Share of right bits in percent, the mean over pictures.
fn percent(pictures: &[&[f32]], message: &Message) -> Result<f64, Box<dyn std::error::Error>> {
    let mut sum = 0.0;
    for logits in pictures {
        sum += Reading::from_logits(logits)?.bit_accuracy(message)?;
    }
    Ok(100.0 * sum / pictures.len() as f64)
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(key), Some(message)) = (arguments.next(), arguments.next()) else {
        return Err("give a key, a message and folders".into());
    };
    let key = Key::read(key.as_ref())?;
    let message = key.message(&message)?;
    let compute = open(DeviceChoice::Cpu)?;
    let shipped = ShippedClip::named(&key.clip.name).ok_or("the key is not of a CLIP of this repository")?;
    let clip = shipped.load(&compute.device, Parts::Image)?;
    let engine = Engine::new(compute, clip, &key, None)?;
    println!(
        "folder,as_given_percent,estimated_alone_percent,estimated_together_percent,all_pictures_estimated_percent"
    );
    for folder in arguments {
        let mut read: Vec<PictureLogits> = Vec::new();
        for file in find_source(&[folder.clone().into()])?.pictures {
            let picture = PictureLogits::read(&engine, &read_picture(&file, [1.0; 3])?, None, &read)?;
            read.push(picture);
        }
        let given: Vec<&[f32]> = read.iter().map(PictureLogits::as_given).collect();
        let alone = read.iter().flat_map(|picture| estimates(std::slice::from_ref(picture)));
        let alone: Vec<&[f32]> = alone.flatten().map(|estimate| estimate.logits()).collect();
        let together: Vec<&[f32]> = estimates(&read).into_iter().flatten().map(|e| e.logits()).collect();
        let pooled = PooledLogits::new(together.iter().map(|logits| logits.to_vec()).collect())?;
        println!(
            "{folder},{:.1},{:.1},{:.1},{:.1}",
            percent(&given, &message)?,
            percent(&alone, &message)?,
            percent(&together, &message)?,
            percent(&[&pooled.summed], &message)?
        );
    }
    Ok(())
}
