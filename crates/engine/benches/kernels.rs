//! Times the loops of a step on the CPU, one by one: `cargo bench --workspace --locked --bench kernels`.
//!
//! A sample of 30,000 Gaussians of degree 3 and views of 160 px, as `standard` has them, on all threads; `RAYON_NUM_THREADS=1`
//! for one. Criterion tells whether a run differs from the one before. Whole steps: `examples/bench_step`.
use std::hint::black_box;
use std::time::Duration;

use burn::tensor::{Device, Tensor, TensorData};
use criterion::{Criterion, criterion_group, criterion_main};
use guardsplat_engine::clip::{Clip, Parts};
use guardsplat_engine::embed::{PreconditionedSgd, PreconditionedSgdOptions};
use guardsplat_engine::sample::sample;
use guardsplat_engine::splat::sh::{ColourGradient, backward_of_views, colours_of_views};
use guardsplat_engine::splat::{CpuRasterizer, Geometry, Learnable, PreparedView, Rasterizer, WeightCache};
use guardsplat_engine::view::{Camera, Split, ViewSampler};

const GAUSSIANS: usize = 30_000;
const SIDE: u32 = 160;
/// Views of a step.
const VIEWS: usize = 8;
/// Views stand for pictures so many times as large.
const TIMES: f32 = 5.0;

fn splatting(criterion: &mut Criterion) {
    let gaussians = sample(GAUSSIANS, 3, 1).expect("a sample").gaussians;
    let geometry = Geometry::new(&gaussians);
    let sampler = ViewSampler::new(&gaussians, 1).expect("views of it");
    let cameras: Vec<Camera> = (0..VIEWS as u64)
        .map(|index| sampler.camera(Split::Training, index, SIDE))
        .collect();
    let prepare = |camera: &Camera, cache| geometry.prepare_averaged(camera, TIMES, cache).expect("a view");
    let views: Vec<PreparedView> = cameras.iter().map(|camera| prepare(camera, WeightCache::Weights)).collect();
    let borrowed: Vec<&PreparedView> = views.iter().collect();
    let colours = colours_of_views(&gaussians.sh, None, &borrowed);
    let picture = CpuRasterizer.render(&views[0], &colours[0], [1.0; 3]).expect("a picture");
    let gradients: Vec<Vec<f32>> = views.iter().map(|view| vec![0.01; 3 * view.visible.len()]).collect();
    let learnable = Learnable::all(&gaussians);
    let mut of_coefficients = vec![0.0; learnable.len()];
    let mut optimizer = PreconditionedSgd::new(
        PreconditionedSgdOptions::default(),
        learnable.columns(),
        &vec![1.0; learnable.rows().len()],
        false,
    );
    let mut offsets = vec![0.0; learnable.len()];

    let mut group = criterion.benchmark_group("splatting");
    group.bench_function("project and sort a view", |b| {
        b.iter(|| prepare(black_box(&cameras[0]), WeightCache::None))
    });
    group.bench_function("prepare a view with its weights", |b| {
        b.iter(|| prepare(black_box(&cameras[0]), WeightCache::Weights))
    });
    group.bench_function("draw a view", |b| {
        b.iter(|| CpuRasterizer.render(black_box(&views[0]), &colours[0], [1.0; 3]))
    });
    group.bench_function("gradient of a view to its splats", |b| {
        b.iter(|| CpuRasterizer.backward(black_box(&views[0]), &picture.pixels))
    });
    group.bench_function("colours of 8 views", |b| {
        b.iter(|| colours_of_views(black_box(&gaussians.sh), None, &borrowed))
    });
    let of_views: Vec<ColourGradient<'_>> = (views.iter().zip(&colours).zip(&gradients))
        .map(|((view, colours), gradient)| ColourGradient {
            view,
            colours,
            gradient,
        })
        .collect();
    group.bench_function("gradient of 8 views' colours to coefficients", |b| {
        b.iter(|| backward_of_views(&learnable, black_box(&of_views), &mut of_coefficients))
    });
    group.bench_function("optimiser", |b| {
        b.iter(|| {
            of_coefficients.fill(1e-4);
            optimizer.step(1.0, 3.0 * (SIDE * SIDE) as f32, &mut offsets, &mut of_coefficients);
        });
    });
    group.finish();
}

fn tower(criterion: &mut Criterion) {
    let device = Device::flex();
    let clip = Clip::shipped(&device, Parts::Image).expect("the shipped CLIP");
    let side = clip.config.vision.image_size;
    let pixels = 3 * side * side;
    let colour = |i: usize| 0.5 + 0.4 * ((i % pixels) as f32 * 1e-3).sin() + 0.1 * (i as f32 * 0.7).sin();
    let pictures = TensorData::new((0..VIEWS * pixels).map(colour).collect::<Vec<f32>>(), [VIEWS, 3, side, side]);
    let mut group = criterion.benchmark_group("tower");
    group.bench_function("features of 8 views", |b| {
        let pictures = Tensor::<4>::from_data(pictures.clone(), &device);
        b.iter(|| clip.features_as_they_are(black_box(pictures.clone())));
    });
    group.bench_function("features of 8 views with their gradient", |b| {
        b.iter(|| {
            let leaf = Tensor::<4>::from_data(pictures.clone(), &device.clone().autodiff()).require_grad();
            leaf.grad(&clip.features_as_they_are(leaf.clone()).sum().backward())
        });
    });
    group.finish();
}

criterion_group! {
    name = kernels;
    config = Criterion::default().sample_size(30).measurement_time(Duration::from_secs(3)).warm_up_time(Duration::from_secs(1));
    targets = splatting, tower
}
criterion_main!(kernels);
