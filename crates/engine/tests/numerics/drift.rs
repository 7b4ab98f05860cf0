//! What lower precision costs: the renderer's weights in half precision against single.
use guardsplat_engine::sample::sample;
use guardsplat_engine::scene::{Gaussians, Scene};
use guardsplat_engine::splat::compare::GradientError;
use guardsplat_engine::splat::{Learnable, Rasterizer, WeightCache, prepare, sh};
use guardsplat_engine::testing::scene_path;
use guardsplat_engine::view::{Split, ViewSampler};

use super::machine::Machine;
use super::scenes::BACKGROUND;

/// A half has eleven digits: relative to the brightest pixel a picture is off by at most 2^-11.
const ROUNDING: f64 = 1.0 / 2048.0;

pub fn half_weights(machine: &Machine) {
    let rasterizer = machine.rasterizer.as_ref();
    compare("sample", &sample(5000, 2, 3).unwrap().gaussians, rasterizer);
    for name in ["playbot_8k.ply", "donut.ply"] {
        if let Some(path) = scene_path(name) {
            compare(name, &Scene::read(&path).unwrap().gaussians, rasterizer);
        }
    }
}

fn compare(name: &str, g: &Gaussians, rasterizer: &dyn Rasterizer) {
    let sampler = ViewSampler::new(g, 1).unwrap();
    let learnable = Learnable::all(g);
    let mut gradients = [vec![0.0f32; learnable.len()], vec![0.0; learnable.len()]];
    let (mut most, mut sum, mut brightest, mut count) = (0.0f64, 0.0, 0.0f64, 0);
    for index in 0..3 {
        let camera = sampler.camera(Split::Training, index, 128);
        let mut pictures = Vec::new();
        for (cache, gradient) in [WeightCache::Weights, WeightCache::HalfWeights]
            .into_iter()
            .zip(&mut gradients)
        {
            let view = prepare(g, &camera, cache).unwrap();
            let colours = sh::colours(&g.sh, None, &view);
            let picture = rasterizer.render(&view, &colours, BACKGROUND).unwrap().pixels;
            let signs: Vec<f32> = (0..picture.len()).map(|i| (i as f32 * 0.61).sin()).collect();
            let of_colours = rasterizer.backward(&view, &signs).unwrap();
            sh::backward(
                &learnable,
                sh::ColourGradient {
                    view: &view,
                    colours: &colours,
                    gradient: &of_colours,
                },
                gradient,
            );
            pictures.push(picture);
        }
        for (single, half) in pictures[0].iter().zip(&pictures[1]) {
            let difference = f64::from((single - half).abs());
            most = most.max(difference);
            sum += difference;
            brightest = brightest.max(f64::from(*single));
            count += 1;
        }
    }
    let mean = sum / f64::from(count);
    let want: Vec<f64> = gradients[0].iter().map(|v| f64::from(*v)).collect();
    let error = GradientError::new(&gradients[1], &want);
    println!("{name}: picture at most {most:.1e}, in the mean {mean:.1e}; gradient {error:?}");
    assert!(most > 0.0 && most <= ROUNDING * brightest, "{most} of {brightest}");
    assert!(mean <= 0.1 * ROUNDING, "{mean}");
    assert!(error.angle <= 1e-6 && error.l2 <= 1e-3, "{error:?}");
    assert!(error.bias.abs() <= 1e-4, "{error:?}");
}
