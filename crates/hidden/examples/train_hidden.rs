//! Trains a decoder on synthetic pictures and prints how well it reads unseen ones, by the strength of the mark:
//! `train_hidden [bits [steps [side [seed [folder]]]]]`. Photographs in the folder are read, too.
use std::path::Path;
use std::time::Instant;

use burn::tensor::{Device, Tensor, TensorData};
use guardsplat_hidden::{Geometry, Options, Progress, Synthetic, train};
use image::imageops::FilterType;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| given.get(i).map_or(Ok(default), |text| text.parse());
    let (side, seed) = (number(2, 96)? as usize, number(3, 0)?);
    let options = Options {
        bits: number(0, 32)? as usize,
        steps: number(1, 2000)? as usize,
        seed,
        ..Options::default()
    };
    let device = Device::flex();
    let photographs = match given.get(4) {
        Some(folder) => read(Path::new(folder), side as u32)?,
        None => Vec::new(),
    };
    let start = Instant::now();
    let report = |p: Progress| {
        if (p.step / 20).is_multiple_of(5) {
            let (seconds, psnr) = (start.elapsed().as_secs_f32(), p.psnr);
            eprintln!(
                "{seconds:6.1} s  {:5}/{}  {psnr:.1} dB  loss {:.4}",
                p.step, p.steps, p.loss
            );
        }
    };
    let mut pictures = Synthetic::new(side, seed)?;
    let trained = train(&options, &device, |n| Ok(pictures.next(n, &device)), report, || false)?;
    let seconds = start.elapsed().as_secs_f32();
    println!("{} bits, {} steps in {seconds:.0} s", options.bits, options.steps);
    for psnr in [30.0, 34.0, 36.0, 37.0, 38.0, 40.0] {
        for (name, geometry) in [("still", Geometry::NONE), ("moved", Geometry::default())] {
            let mut unseen = Synthetic::new(side, seed.wrapping_add(1_000_000))?;
            let found = trained.measure(|n| Ok(unseen.next(n, &device)), 64, psnr, &geometry, 1)?;
            let (percent, reached) = (found.accuracy * 100.0, found.psnr);
            println!("synthetic, {name}, {psnr} dB ({reached:.2} after the clamp): {percent:.2} %");
            if photographs.is_empty() {
                continue;
            }
            let mut endless = photographs.iter().cycle();
            let mut next = |count: usize| {
                let values: Vec<f32> = endless.by_ref().take(count).flatten().copied().collect();
                Ok(Tensor::<4>::from_data(
                    TensorData::new(values, [count, 3, side, side]),
                    &device,
                ))
            };
            let found = trained.measure(&mut next, photographs.len(), psnr, &geometry, 1)?;
            let (percent, reached) = (found.accuracy * 100.0, found.psnr);
            println!("photographs, {name}, {psnr} dB ({reached:.2} after the clamp): {percent:.2} %");
        }
    }
    Ok(())
}

/// All pictures of a folder, cut to squares of `side`, a channel after the other.
fn read(folder: &Path, side: u32) -> Result<Vec<Vec<f32>>, Box<dyn std::error::Error>> {
    let paths = std::fs::read_dir(folder)?.map(|entry| entry.map(|e| e.path()));
    let mut paths = paths.collect::<Result<Vec<_>, _>>()?;
    paths.sort();
    let mut all = Vec::new();
    for path in paths {
        let picture = image::open(path)?.resize_to_fill(side, side, FilterType::Triangle);
        let picture = picture.to_rgb8();
        let channel = |c: usize| picture.pixels().map(move |pixel| f32::from(pixel.0[c]) / 255.0);
        all.push((0..3).flat_map(channel).collect());
    }
    Ok(all)
}
