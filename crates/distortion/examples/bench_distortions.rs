//! Measures each distortion: milliseconds a picture, forward alone and forward with backward, in batches of eight.
//!
//! `cargo run --release -p guardsplat-distortion --example bench_distortions [SECONDS]`; each figure is the best of
//! several runs in the given time (0.5 s).
use std::time::{Duration, Instant};

use burn::tensor::{Device, Tensor, TensorData};
use guardsplat_distortion::{Chroma, DistortionKind, Draw, Jpeg, JpegRange, Layer, Ranges, RobustTo};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const BATCH: usize = 8;

/// Draws of one kind for a whole batch, from the default ranges.
fn draws(kind: DistortionKind, ranges: Ranges) -> Vec<Draw> {
    let layer = Layer {
        robust_to: RobustTo::from_iter([kind]),
        ranges,
    };
    let all = layer.draw(20 * BATCH, &mut ChaCha8Rng::seed_from_u64(1));
    let distorted = all.into_iter().filter(|draw| draw.kind().is_some());
    distorted.take(BATCH).collect()
}

/// Best time of what `run` does, in milliseconds a picture.
fn best(seconds: f64, mut run: impl FnMut()) -> f64 {
    run();
    let (begin, mut best) = (Instant::now(), Duration::MAX);
    while begin.elapsed().as_secs_f64() < seconds {
        let start = Instant::now();
        run();
        best = best.min(start.elapsed());
    }
    best.as_secs_f64() * 1e3 / BATCH as f64
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let seconds = std::env::args().nth(1).map_or(Ok(0.5), |text| text.parse::<f64>())?;
    let mut cases: Vec<(String, Vec<Draw>)> = DistortionKind::ALL
        .into_iter()
        .filter(|kind| !kind.acts_on_scene())
        .map(|kind| (kind.to_string(), draws(kind, Ranges::default())))
        .collect();
    let full = Ranges {
        jpeg: JpegRange {
            chroma: Chroma::Full,
            ..JpegRange::default()
        },
        ..Ranges::default()
    };
    cases.push(("jpeg 4:4:4".into(), draws(DistortionKind::Jpeg, full)));
    let noisy = Jpeg {
        quality: 10,
        chroma: Chroma::Half,
        noise: Some(1),
    };
    cases.push(("jpeg, noise".into(), vec![Draw::Jpeg(noisy); BATCH]));
    let layer = Layer {
        robust_to: RobustTo::all(),
        ..Layer::default()
    };
    cases.push(("mixed".into(), layer.draw(BATCH, &mut ChaCha8Rng::seed_from_u64(2))));

    println!(
        "{:<14}{:>12}{:>12}{:>12}{:>12}",
        "ms a picture", "160 forward", "and back", "480 forward", "and back"
    );
    for (name, draws) in &cases {
        print!("{name:<14}");
        for side in [160, 480] {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let values: Vec<f32> = (0..BATCH * 3 * side * side).map(|_| rng.random()).collect();
            let data = TensorData::new(values, [BATCH, 3, side, side]);
            let input = Tensor::<4>::from_data(data, &Device::flex());
            let forward = || layer.apply_with(draws, input.clone(), [1.0; 3]);
            forward()?;
            let alone = best(seconds, || drop(forward()));
            let both = best(seconds, || {
                let x = input.clone().autodiff().require_grad();
                let done = layer.apply_with(draws, x.clone(), [1.0; 3]);
                drop(done.map(|y| x.grad(&y.sum().backward())));
            });
            print!("{alone:>12.2}{both:>12.2}");
        }
        println!();
    }
    Ok(())
}
