//! What every rasteriser must do: run for the CPU here and for the GPU in its module. Scenes at the limits of what is
//! legal are in `tests/numerics`.
use super::compare::Agreement;
use super::{CpuRasterizer, Learnable, PreparedView, Rasterizer, WeightCache, prepare, sh};
use crate::picture::Picture;
use crate::scene::{Gaussians, Scene, Sh};
use crate::testing::scene_path;
use crate::view::Camera;

/// A square picture from the origin along +z, 60 degrees wide; the scenes of [`scene`] are in front of it.
pub(super) fn camera(size: u32) -> Camera {
    Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 1.05, size, size)
}

/// `n` Gaussians of all shapes between depths 2 and 6, some of their colours clamped.
pub(super) fn scene(n: usize, degree: usize) -> Gaussians {
    let mut state = 1u64;
    let mut random = move |low: f32, high: f32| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut g = Gaussians {
        sh: Sh {
            degree,
            coefficients: Vec::new(),
        },
        ..Gaussians::default()
    };
    for _ in 0..n {
        let z = random(2.0, 6.0);
        g.positions.push([random(-0.5, 0.5) * z, random(-0.5, 0.5) * z, z]);
        g.rotations.push(std::array::from_fn(|_| random(-1.0, 1.0)));
        g.log_scales.push(std::array::from_fn(|_| random(-4.0, -1.0)));
        g.opacity_logits.push(random(-3.0, 6.0));
        let count = g.sh.per_gaussian();
        g.sh.coefficients
            .extend((0..count).map(|k| if k < 3 { random(-2.5, 2.5) } else { random(-0.9, 0.9) }));
    }
    g
}

fn playbot() -> Option<Gaussians> {
    Some(Scene::read(&scene_path("playbot_8k.ply")?).unwrap().gaussians)
}

/// A camera that has the middle of `g` in view.
fn facing(g: &Gaussians, size: u32) -> Camera {
    let median = |mut v: Vec<f32>| {
        v.sort_by(f32::total_cmp);
        v[v.len() / 2]
    };
    let centre: [f32; 3] = std::array::from_fn(|k| median(g.positions.iter().map(|p| p[k]).collect()));
    let spread = (0..3)
        .map(|k| median(g.positions.iter().map(|p| (p[k] - centre[k]).abs()).collect()))
        .fold(0.0, f32::max);
    let eye = [
        centre[0] + 4.0 * spread,
        centre[1] + 2.0 * spread,
        centre[2] + 5.0 * spread,
    ];
    Camera::look_at(eye, centre, [0.0, 1.0, 0.0], 0.8, size, size)
}

const BACKGROUND: [f32; 3] = [0.2, 0.6, 1.0];

/// Picture and gradient agree with the reference.
fn agrees(rasterizer: &dyn Rasterizer, cache: WeightCache, g: &Gaussians, camera: &Camera) {
    let found = Agreement::of(rasterizer, cache, g, camera, BACKGROUND).unwrap();
    let (name, n, width) = (rasterizer.name(), g.len(), camera.width);
    println!("{name} {cache:?}, {n} Gaussians, {width} px: {found}");
    assert!(found.holds(), "{found}");
}

/// Needles, discs, pixel-small ones, saturated and faint ones, zero quaternions, colours far out of range, some
/// beside the picture.
fn shapes() -> Gaussians {
    let mut g = scene(240, 2);
    for i in 0..g.len() {
        let z = g.positions[i][2];
        match i % 6 {
            0 => g.log_scales[i] = [0.5, -9.0, -9.0],
            1 => g.log_scales[i] = [-1.0, -1.0, -30.0],
            2 => g.log_scales[i] = [-12.0; 3],
            3 => g.opacity_logits[i] = if i % 12 == 3 { f32::INFINITY } else { -5.3 },
            4 => g.rotations[i] = [0.0; 4],
            _ => g.sh.coefficients[i * 27] = if i % 12 == 5 { 3.0 } else { -8.0 },
        }
        if i % 7 == 0 {
            // Beyond the edge of the picture and reaching in: where the Jacobian's clamp acts.
            g.positions[i][i % 2] = 0.9 * z;
            g.log_scales[i] = [0.2, -0.5, -1.0];
            g.opacity_logits[i] = -1.0;
        }
    }
    g
}

/// All that a rasteriser must do, for one kind of prepared view.
pub(super) fn conforms(rasterizer: &dyn Rasterizer, cache: WeightCache) {
    for degree in 0..=4 {
        agrees(rasterizer, cache, &scene(300, degree), &camera(70));
    }
    agrees(
        rasterizer,
        cache,
        &scene(3000, 1),
        &Camera {
            width: 50,
            height: 41,
            cx: 21.0,
            cy: 22.5,
            ..camera(41)
        },
    );
    agrees(rasterizer, cache, &shapes(), &camera(64));
    if let Some(g) = playbot() {
        agrees(rasterizer, cache, &g, &facing(&g, 96));
    }
}

#[test]
fn the_cpu_agrees_with_the_reference() {
    conforms(&CpuRasterizer, WeightCache::Weights);
    conforms(&CpuRasterizer, WeightCache::None);
}

/// A view, its picture, and the gradient of half the picture's squares to the coefficients.
fn drawn_and_back(g: &Gaussians, camera: &Camera, cache: WeightCache) -> (PreparedView, Picture, Vec<f32>) {
    let view = prepare(g, camera, cache).unwrap();
    let colours = sh::colours(&g.sh, None, &view);
    let picture = CpuRasterizer.render(&view, &colours, BACKGROUND).unwrap();
    let gradient = CpuRasterizer.backward(&view, &picture.pixels).unwrap();
    let mut all = vec![0.0f32; g.sh.coefficients.len()];
    sh::backward(
        &Learnable::all(g),
        sh::ColourGradient {
            view: &view,
            colours: &colours,
            gradient: &gradient,
        },
        &mut all,
    );
    (view, picture, all)
}

#[test]
fn cached_and_fresh_weights_give_the_same_bytes() {
    let g = scene(2000, 1);
    let camera = camera(75);
    let run = |cache| drawn_and_back(&g, &camera, cache);
    let (plain, kept) = (run(WeightCache::None), run(WeightCache::Weights));
    assert_eq!(plain.1, kept.1);
    assert_eq!(plain.2, kept.2);
    assert!(
        kept.0.visible.len() < plain.0.visible.len(),
        "hidden Gaussians are dropped"
    );
    assert!(kept.0.visible.is_sorted() && kept.0.weight_count() > Some(10_000));
    // A view whose hidden pairs were dropped still composites to the same picture.
    let again = PreparedView {
        weights: None,
        ..kept.0
    };
    let colours = sh::colours(&g.sh, None, &again);
    assert_eq!(CpuRasterizer.render(&again, &colours, BACKGROUND).unwrap(), plain.1);
}

/// Half precision is within its rounding of single: 2^-11 of every weight.
#[test]
fn half_precision_is_off_by_its_rounding() {
    let g = scene(2000, 1);
    let camera = camera(75);
    let run = |cache| {
        let view = prepare(&g, &camera, cache).unwrap();
        let colours = sh::colours(&g.sh, None, &view);
        let picture = CpuRasterizer.render(&view, &colours, BACKGROUND).unwrap();
        let signs: Vec<f32> = (0..picture.pixels.len()).map(|i| (i as f32 * 0.61).sin()).collect();
        let gradient = CpuRasterizer.backward(&view, &signs).unwrap();
        (picture.pixels, gradient, view.weight_bytes())
    };
    let (single, half) = (run(WeightCache::Weights), run(WeightCache::HalfWeights));
    let largest = single.0.iter().fold(0.0f32, |m, v| m.max(*v));
    let worst = single
        .0
        .iter()
        .zip(&half.0)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f32::max);
    assert!(worst > 0.0 && worst < largest / 2048.0, "{worst} of {largest}");
    let product = |a: &[f32], b: &[f32]| -> f64 { a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum() };
    let cosine = product(&single.1, &half.1) / (product(&single.1, &single.1) * product(&half.1, &half.1)).sqrt();
    // The signs of the picture's gradient cancel most of it, and what is left shows the rounding more.
    assert!(cosine > 0.999_99, "{cosine}");
    assert!(half.2 < single.2 * 7 / 10);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let g = scene(9000, 2);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| drawn_and_back(&g, &camera(90), WeightCache::Weights))
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one.0, two.0);
    assert_eq!(
        bytemuck::cast_slice::<f32, u8>(&one.1.pixels),
        bytemuck::cast_slice::<f32, u8>(&two.1.pixels)
    );
    assert_eq!(
        bytemuck::cast_slice::<f32, u8>(&one.2),
        bytemuck::cast_slice::<f32, u8>(&two.2)
    );
}

#[test]
fn wrong_sizes_and_cameras_are_errors() {
    let g = scene(5, 0);
    let view = prepare(&g, &camera(20), WeightCache::Weights).unwrap();
    assert!(
        CpuRasterizer
            .render(&view, &[0.0; 2], BACKGROUND)
            .unwrap_err()
            .to_string()
            .starts_with("colours: 2 numbers")
    );
    assert!(CpuRasterizer.backward(&view, &[0.0; 7]).is_err());
    let broken: [fn(&mut Camera); 5] = [
        |c| c.width = 0,
        |c| c.height = 1 << 20,
        |c| c.fx = 0.0,
        |c| c.fy = f32::NAN,
        |c| c.translation[1] = f32::INFINITY,
    ];
    for change in broken {
        let mut camera = camera(20);
        change(&mut camera);
        assert!(
            prepare(&g, &camera, WeightCache::None)
                .unwrap_err()
                .to_string()
                .starts_with("camera: ")
        );
    }
}
