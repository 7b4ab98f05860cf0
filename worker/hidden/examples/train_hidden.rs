//! Trains a decoder on synthetic pictures and prints how well it reads: `train_hidden [bits [steps [side [seed]]]]`.
use std::time::Instant;

use burn::tensor::Device;
use guardsplat_hidden::{Geometry, Options, Synthetic, train};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given: Vec<u64> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let number = |i: usize, default: u64| given.get(i).copied().unwrap_or(default);
    let options = Options {
        bits: number(0, 32) as usize,
        steps: number(1, 2000) as usize,
        seed: number(3, 0),
        learning_rate: std::env::var("LR").map_or(2e-3, |v| v.parse().unwrap()),
        ..Options::default()
    };
    let device = Device::flex();
    let mut pictures = Synthetic::new(number(2, 96) as usize, options.seed)?;
    let start = Instant::now();
    let report = |p: guardsplat_hidden::Progress| {
        if (p.step / 20) % 5 == 0 {
            let seconds = start.elapsed().as_secs_f32();
            eprintln!(
                "{seconds:6.1} s  {:5}/{}  {:.1} dB  loss {:.4}",
                p.step, p.steps, p.psnr, p.loss
            );
        }
    };
    let trained = train(&options, &device, |n| Ok(pictures.next(n, &device)), report, || false)?;
    println!(
        "{} bits, {} steps in {:.0} s",
        options.bits,
        options.steps,
        start.elapsed().as_secs_f32()
    );
    for psnr in [34.0, 36.0, 37.0, 38.0, 40.0] {
        for geometry in [Geometry::NONE, Geometry::default()] {
            let mut unseen = Synthetic::new(number(2, 96) as usize, options.seed + 1_000_000)?;
            let found = trained.measure(|n| Ok(unseen.next(n, &device)), 128, psnr, &geometry, 1)?;
            println!(
                "asked {psnr} dB, got {:.2} dB, {geometry:?}: {:.2} %",
                found.psnr,
                found.accuracy * 100.0
            );
        }
    }
    Ok(())
}
