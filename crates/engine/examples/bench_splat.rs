//! Times the renderer on a scene, on an otherwise idle machine:
//! `cargo run --release --example bench_splat -- SCENE.ply SIZE [VIEWS] [wgpu]`.
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::scene::{Gaussians, Scene};
use guardsplat_engine::splat::{CpuRasterizer, GpuRasterizer, Learnable, Rasterizer, WeightCache, prepare, sh};
use guardsplat_engine::view::Camera;
use std::time::Instant;

/// Of so many rounds the fastest counts: whatever else runs can only add time.
const ROUNDS: usize = 5;
const STAGES: [&str; 5] = ["prepare", "colours", "render", "backward", "SH backward"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(path), Some(size)) = (arguments.next(), arguments.next()) else {
        return Err("usage: bench_splat SCENE.ply SIZE [VIEWS] [wgpu]".into());
    };
    let size: u32 = size.parse()?;
    let views: usize = arguments.next().map_or(Ok(8), |v| v.parse())?;
    let gaussians = Scene::read(path.as_ref())?.gaussians;
    let cameras: Vec<Camera> = (0..views)
        .map(|i| orbit(&gaussians, i as f32 / views as f32, size))
        .collect();
    println!(
        "{path}: {} Gaussians, degree {}, {views} views of {size} px, {} threads",
        gaussians.len(),
        gaussians.sh.degree,
        rayon::current_num_threads()
    );
    measure(&CpuRasterizer, &gaussians, &cameras, WeightCache::None)?;
    measure(&CpuRasterizer, &gaussians, &cameras, WeightCache::Weights)?;
    if arguments.next().as_deref() == Some("wgpu") {
        let compute = open(DeviceChoice::Wgpu)?;
        let rasterizer = GpuRasterizer::new(&compute.device)?;
        measure(&rasterizer, &gaussians, &cameras, WeightCache::None)?;
    }
    Ok(())
}

/// Prints the mean milliseconds a view of each stage.
fn measure(
    rasterizer: &dyn Rasterizer,
    gaussians: &Gaussians,
    cameras: &[Camera],
    cache: WeightCache,
) -> guardsplat_engine::Result<()> {
    let learnable = Learnable::all(gaussians);
    let mut best = [f64::INFINITY; STAGES.len()];
    let mut size = String::new();
    for _ in 0..ROUNDS {
        let mut ms = [0.0f64; STAGES.len()];
        let (mut visible, mut pairs, mut weights, mut bytes) = (0, 0, 0, 0);
        for camera in cameras {
            let mut sum = vec![0.0; learnable.len()];
            let mut clock = Instant::now();
            let mut lap = |stage: usize| {
                ms[stage] += clock.elapsed().as_secs_f64() * 1e3 / cameras.len() as f64;
                clock = Instant::now();
            };
            let view = prepare(gaussians, camera, cache)?;
            lap(0);
            let colours = sh::colours(&gaussians.sh, None, &view);
            lap(1);
            let picture = rasterizer.render(&view, &colours, [1.0; 3])?;
            lap(2);
            let gradient = rasterizer.backward(&view, &picture.pixels)?;
            lap(3);
            sh::backward(
                &learnable,
                sh::ColourGradient {
                    view: &view,
                    colours: &colours,
                    gradient: &gradient,
                },
                &mut sum,
            );
            lap(4);
            visible += view.visible.len() / cameras.len();
            pairs += view.tiles.pairs() / cameras.len();
            weights += view.weight_count().unwrap_or(0) / cameras.len();
            bytes += view.bytes() / cameras.len();
        }
        best = std::array::from_fn(|k| best[k].min(ms[k]));
        let megabytes = bytes as f64 / 1e6;
        size = format!("{visible} visible, {pairs} pairs, {weights} weights, {megabytes:.2} MB");
    }
    let stages: Vec<String> = STAGES
        .iter()
        .zip(best)
        .map(|(name, ms)| format!("{name} {ms:.2}"))
        .collect();
    println!(
        "{} {cache:?}: {} ms; {size} a view",
        rasterizer.name(),
        stages.join(", ")
    );
    Ok(())
}

/// A camera on a ring around the scene's median, far enough to see most of it.
fn orbit(gaussians: &Gaussians, turn: f32, size: u32) -> Camera {
    let median = |mut v: Vec<f32>| {
        v.sort_by(f32::total_cmp);
        v.get(v.len() / 2).copied().unwrap_or(0.0)
    };
    let p = &gaussians.positions;
    let centre: [f32; 3] = std::array::from_fn(|k| median(p.iter().map(|p| p[k]).collect()));
    let spread = |k: usize| median(p.iter().map(|p| (p[k] - centre[k]).abs()).collect());
    let radius = 4.0 * (0..3).map(spread).fold(0.0, f32::max);
    let (s, c) = (turn * std::f32::consts::TAU).sin_cos();
    let eye = [
        centre[0] + radius * 1.6 * c,
        centre[1] + 0.4 * radius,
        centre[2] + radius * 1.6 * s,
    ];
    Camera::look_at(eye, centre, [0.0, 1.0, 0.0], 0.8, size, size)
}
