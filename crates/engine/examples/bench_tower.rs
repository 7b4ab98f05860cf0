//! Times the shipped image tower with its gradient to the pictures, on the CPU device.
//!
//!     cargo run --release -p guardsplat-engine --example bench_tower -- [VIEWS] [ROUNDS]
//!
//! Prints the fewest milliseconds of all rounds, and nanoseconds for each sine with its cosine. `tools/tower_bench.py` runs it
//! in turns with the same tower in PyTorch.
use std::time::Instant;

use burn::tensor::{Device, Tensor, TensorData};
use guardsplat_engine::clip::{Clip, Parts};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: usize| arguments.next().map_or(Ok(default), |text| text.parse());
    let (views, rounds) = (number(8)?, number(20)?);
    let device = Device::flex();
    let clip = Clip::shipped(&device, Parts::Image)?;
    let side = clip.config.vision.image_size;
    let pixels = 3 * side * side;
    // Smooth in places and rough in others, as views are.
    let colour = |i: usize| 0.5 + 0.4 * ((i % pixels) as f32 * 1e-3).sin() + 0.1 * (i as f32 * 0.7).sin();
    let pictures: Vec<f32> = (0..views * pixels).map(colour).collect();
    let pictures = TensorData::new(pictures, [views, 3, side, side]);
    let sines: usize = [1, 2, 4].map(|size| side / size).iter().map(|side| side * side).sum();
    let sines = sines * clip.config.vision.width * views;

    let mut best = [f64::INFINITY; 2];
    for _ in 0..rounds {
        let leaf = Tensor::<4>::from_data(pictures.clone(), &device.clone().autodiff()).require_grad();
        let clock = Instant::now();
        let loss = clip.features_as_they_are(leaf.clone()).sum();
        let forward = clock.elapsed().as_secs_f64();
        let gradient = leaf.grad(&loss.backward());
        let both = clock.elapsed().as_secs_f64();
        std::hint::black_box(gradient);
        best = [best[0].min(forward), best[1].min(both)];
    }
    let [forward, both] = best.map(|seconds| seconds * 1e3);
    println!("views {views}, sines {sines}");
    println!("forward_ms {forward:.2}");
    println!("forward_and_gradient_ms {both:.2}");
    println!("ns_per_sine {:.3}", both * 1e6 / sines as f64);
    Ok(())
}
