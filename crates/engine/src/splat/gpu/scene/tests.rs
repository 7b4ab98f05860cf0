use super::*;
use crate::picture::Picture;
use crate::quality::{batch, unbatch};
use crate::splat::checks::{camera, scene};
use crate::splat::{Changes, CpuRasterizer, Drawing, PreparedView, Rasterizer, Shown, WeightCache, prepare, sh};
use crate::testing::wgpu;

const BACKGROUNDS: [[f32; 3]; 3] = [[1.0; 3], [0.0; 3], [0.2, 0.6, 1.0]];

/// Three views of `g`, one of which shows fewer bands, and the changes of two of three Gaussians up to degree 1.
struct Case {
    g: Gaussians,
    views: Vec<PreparedView>,
    noise: Vec<f32>,
    learnable: Learnable,
    offsets: Vec<f32>,
}

fn case() -> Case {
    let g = scene(600, 3);
    let mut views: Vec<PreparedView> = [0.0, 0.3, -0.4]
        .map(|x| {
            let mut camera = camera(32);
            camera.translation[0] += x;
            prepare(&g, &camera, WeightCache::None).unwrap()
        })
        .into();
    views[1].degree = 1;
    let noise = (0..3 * views[2].visible.len()).map(|i| ((i % 13) as f32 - 6.0) * 0.01);
    let seen: Vec<bool> = (0..g.len()).map(|row| row % 3 != 1).collect();
    let learnable = Learnable::new(&seen, 1);
    Case {
        offsets: (0..learnable.len())
            .map(|i| ((i * 31 % 17) as f32 - 8.0) * 0.03)
            .collect(),
        noise: noise.collect(),
        views,
        learnable,
        g,
    }
}

fn close(found: &[f32], want: &[f32], what: &str) {
    assert_eq!(found.len(), want.len(), "{what}");
    let largest = want.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    let off = found.iter().zip(want).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(
        largest > 0.0 && off < 1e-4 * largest.max(1.0),
        "{what}: {off} of {largest}"
    );
}

/// Also where buffers hold but one view, and a few rows of the scene.
#[test]
fn a_scene_on_a_card_is_drawn_and_differentiated_as_on_the_cpu() {
    let Some(compute) = wgpu() else { return };
    let device = compute.device;
    let Case {
        g,
        views,
        noise,
        learnable,
        offsets,
    } = case();
    let prepared: Vec<&PreparedView> = views.iter().collect();
    let changes = Changes {
        learnable: &learnable,
        values: &offsets,
    };
    let [colours, before] = [Some(changes), None].map(|changes| {
        let mut colours = sh::colours_of_views(&g.sh, changes, &prepared);
        for (colour, noise) in colours[2].iter_mut().zip(&noise) {
            *colour = (*colour + noise).max(0.0);
        }
        colours
    });
    let [drawings, unmarked] = [&colours, &before].map(|colours| {
        let drawing = |i: usize| Drawing {
            view: &views[i],
            colours: &colours[i],
            background: BACKGROUNDS[i],
        };
        (0..3).map(drawing).collect::<Vec<Drawing<'_>>>()
    });
    let [pictures, unmarked] = [&drawings, &unmarked].map(|drawings| CpuRasterizer.render_all(drawings).unwrap());
    // Some gradient: the pictures themselves.
    let gradients = CpuRasterizer.backward_all(&prepared, &pictures).unwrap();
    let of_views: Vec<sh::ColourGradient<'_>> = (0..3)
        .map(|i| sh::ColourGradient {
            view: &views[i],
            colours: &colours[i],
            gradient: &gradients[i],
        })
        .collect();
    let mut gradient = vec![0.0; learnable.len()];
    sh::backward_of_views(&learnable, &of_views, &mut gradient);

    for limit in [u64::MAX, 40_000] {
        let mut rasterizer = GpuRasterizer::new(&device).unwrap();
        rasterizer.limit = rasterizer.limit.min(limit);
        let mut on_device = SceneOnDevice::new(&rasterizer, &g, &learnable);
        on_device.set_offsets(&rasterizer, &offsets);
        let shown: Vec<Shown<'_>> = drawings.iter().map(Shown::from).collect();
        let all = rasterizer.batch(&shown).unwrap();
        let split = limit < u64::MAX;
        assert_eq!(
            (all.groups.len(), on_device.chunks.len() > 1),
            (if split { 3 } else { 1 }, split)
        );
        let of_noise: [&[f32]; 3] = [&[], &[], &noise];
        let [colours, originals] = on_device.colours(&rasterizer, &all, &of_noise);
        let drawn = rasterizer.composite_both(&all, &colours, &originals).unwrap();
        for (found, want) in unbatch(drawn.pictures).unwrap().iter().zip(&pictures) {
            close(&found.pixels, &want.pixels, "pictures");
        }
        for (found, want) in unbatch(drawn.originals).unwrap().iter().zip(&unmarked) {
            close(&found.pixels, &want.pixels, "unmarked pictures");
        }
        let of_pictures = batch(&pictures.iter().collect::<Vec<&Picture>>(), &device).unwrap();
        let slots = rasterizer.slot_gradients(&all, &drawn.lights, of_pictures).unwrap();
        on_device.differentiate(&rasterizer, &all, &colours, &slots);
        let mut found = Vec::new();
        on_device
            .read(&rasterizer, |chunk| &chunk.gradient, &mut found)
            .unwrap();
        close(&found, &gradient, "gradient");
    }
}
