//! Whoever has a marked scene renders it, throws its colours away, and trains new ones from the pictures.
use guardsplat_engine::extract::default_size;
use guardsplat_engine::scene::{Gaussians, Sh};
use guardsplat_engine::splat::{Geometry, Learnable, WeightCache, sh};
use guardsplat_engine::view::{Split, ViewSampler};

use crate::attacked::Attacked;

const WHITE: [f32; 3] = [1.0; 3];
/// Of Adam, as scenes are trained with it.
const RATE: f32 = 0.01;

/// Colours of degree 0 from nothing but pictures of `scene`, with its geometry; after each of `steps` it is looked at.
fn trained(it: &Attacked, scene: &Gaussians, steps: &[usize], mut look: impl FnMut(usize, &Gaussians)) {
    let count = scene.len();
    let mut copy = Gaussians {
        sh: Sh {
            degree: 0,
            coefficients: vec![0.0; 3 * count],
        },
        ..scene.clone()
    };
    let geometry = Geometry::new(scene);
    let learnable = Learnable::all(&copy);
    let sampler = ViewSampler::new(scene, 4242).unwrap();
    let (mut first, mut second) = (vec![0.0_f32; 3 * count], vec![0.0_f32; 3 * count]);
    let last = steps.iter().copied().max().unwrap_or(0);
    for step in 1..=last {
        let camera = sampler.camera(Split::Training, step as u64, 2 * default_size(&it.engine));
        // The attacker has the scene, so as many pictures of it as they like, with 8 bits a channel.
        let wanted = it.engine.picture(&geometry, &camera, WHITE).unwrap();
        let view = geometry.prepare(&camera, WeightCache::None).unwrap();
        let colours = sh::colours(&copy.sh, None, &view);
        let rasterizer = it.engine.rasterizer().unwrap();
        let shown = rasterizer.render(&view, &colours, WHITE).unwrap();
        let gradient: Vec<f32> = shown
            .pixels
            .iter()
            .zip(&wanted.pixels)
            .map(|(a, b)| 2.0 * (a - b))
            .collect();
        let gradient = rasterizer.backward(&view, &gradient).unwrap();
        let mut change = vec![0.0; learnable.len()];
        sh::backward(
            &learnable,
            sh::ColourGradient {
                view: &view,
                colours: &colours,
                gradient: &gradient,
            },
            &mut change,
        );
        let [b1, b2] = [0.9_f32, 0.999];
        let correction = (1.0 - b2.powi(step as i32)).sqrt() / (1.0 - b1.powi(step as i32));
        for (i, g) in change.into_iter().enumerate() {
            first[i] = b1 * first[i] + (1.0 - b1) * g;
            second[i] = b2 * second[i] + (1.0 - b2) * g * g;
            copy.sh.coefficients[i] -= RATE * correction * first[i] / (second[i].sqrt() + 1e-12);
        }
        if steps.contains(&step) {
            look(step, &copy);
        }
    }
}

/// The mark is in the pictures, so whoever copies these copies it: it comes back as the likeness does.
#[test]
#[ignore = "minutes; run by people: docs/security.md"]
fn a_scene_that_was_trained_from_renders_has_the_mark() {
    let Some(it) = Attacked::new() else { return };
    println!("figure: marked: {}", it.left(&it.marked));
    trained(&it, &it.marked, &[25, 50, 100, 200, 400, 800], |step, copy| {
        println!("figure: retrained, {step} steps: {}", it.left(copy));
    });
}
