//! Times the renderer on a scene, on an otherwise idle machine:
//! `cargo run --release --example bench_splat -- SCENE.ply SIZE [VIEWS] [wgpu]`.
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::scene::{Gaussians, Scene};
use guardsplat_engine::splat::{
    CpuRasterizer, Drawing, GpuRasterizer, Learnable, PreparedView, Rasterizer, WeightCache, prepare, sh,
};
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

/// Prints the mean milliseconds a view of each stage; colours and their gradients are those of all views at once, as in a
/// step of an embedding.
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
        let mut sum = vec![0.0; learnable.len()];
        let mut clock = Instant::now();
        let mut lap = |stage: usize| {
            ms[stage] = clock.elapsed().as_secs_f64() * 1e3 / cameras.len() as f64;
            clock = Instant::now();
        };
        let prepared = cameras.iter().map(|camera| prepare(gaussians, camera, cache));
        let prepared: Vec<PreparedView> = prepared.collect::<guardsplat_engine::Result<_>>()?;
        let views: Vec<&PreparedView> = prepared.iter().collect();
        lap(0);
        let colours = sh::colours_of_views(&gaussians.sh, None, &views);
        lap(1);
        let drawings = views.iter().zip(&colours).map(|(view, colours)| Drawing {
            view,
            colours,
            background: [1.0; 3],
        });
        let pictures = rasterizer.render_all(&drawings.collect::<Vec<_>>())?;
        lap(2);
        let gradients = rasterizer.backward_all(&views, &pictures)?;
        lap(3);
        let of_views = views.iter().zip(&colours).zip(&gradients);
        let of_views = of_views.map(|((view, colours), gradient)| sh::ColourGradient {
            view,
            colours,
            gradient,
        });
        sh::backward_of_views(&learnable, &of_views.collect::<Vec<_>>(), &mut sum);
        lap(4);
        best = std::array::from_fn(|k| best[k].min(ms[k]));
        let mean = |of: fn(&PreparedView) -> usize| prepared.iter().map(of).sum::<usize>() / cameras.len();
        size = format!(
            "{} visible, {} pairs, {} weights, {:.2} MB",
            mean(|view| view.visible.len()),
            mean(|view| view.tiles.pairs()),
            mean(|view| view.weight_count().unwrap_or(0)),
            mean(PreparedView::bytes) as f64 / 1e6
        );
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
