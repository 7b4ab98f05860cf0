//! Input that is legal and strange, as the renderer meets it: what must be background is, and all numbers are finite.
use guardsplat_engine::scene::Gaussians;
use guardsplat_engine::splat::compare::Agreement;
use guardsplat_engine::splat::{Learnable, WeightCache, prepare, sh};
use guardsplat_engine::view::{Camera, Extent, ViewSampler};

use super::machine::Machine;
use super::scenes::{BACKGROUND, camera, none, one, ordinary};

/// Side of the pictures.
const SIDE: usize = 40;

/// What a scene looks like, and the gradient to its coefficients where that to the picture is 1 everywhere.
struct Drawn {
    visible: usize,
    pixels: Vec<f32>,
    gradient: Vec<f32>,
}

/// Draws with one kind of prepared view; whatever the scene, every number must be finite.
fn draw_with(machine: &Machine, cache: WeightCache, g: &Gaussians, camera: &Camera) -> Drawn {
    let view = prepare(g, camera, cache).unwrap();
    assert!(view.directions.iter().flatten().all(|v| v.is_finite()));
    let colours = sh::colours(&g.sh, None, &view);
    let pixels = machine.rasterizer.render(&view, &colours, BACKGROUND).unwrap().pixels;
    let of_colours = machine.rasterizer.backward(&view, &vec![1.0; pixels.len()]).unwrap();
    let mut gradient = vec![0.0; g.sh.coefficients.len()];
    sh::backward(
        &Learnable::all(g),
        sh::ColourGradient {
            view: &view,
            colours: &colours,
            gradient: &of_colours,
        },
        &mut gradient,
    );
    assert!(pixels.iter().chain(&gradient).all(|v| v.is_finite()));
    Drawn {
        visible: view.visible.len(),
        pixels,
        gradient,
    }
}

fn draw(machine: &Machine, g: &Gaussians) -> Vec<Drawn> {
    let caches = machine.caches.iter();
    caches
        .map(|cache| draw_with(machine, *cache, g, &camera(SIDE as u32)))
        .collect()
}

/// Nothing of the scene is seen: the background alone, and no gradient.
fn empty(machine: &Machine, g: &Gaussians) {
    for drawn in draw(machine, g) {
        assert_eq!(drawn.visible, 0);
        assert!(drawn.pixels.chunks(3).all(|p| p == BACKGROUND));
        assert!(drawn.gradient.iter().all(|v| *v == 0.0));
    }
}

/// The one Gaussian is seen; gives what it looks like.
fn seen(machine: &Machine, g: &Gaussians) -> Drawn {
    let mut all = draw(machine, g);
    for drawn in &all {
        assert_eq!(drawn.visible, 1);
        assert!(drawn.pixels.chunks(3).any(|p| p != BACKGROUND));
        assert!(drawn.gradient.iter().any(|v| *v != 0.0));
    }
    all.remove(0)
}

fn agrees(machine: &Machine, g: &Gaussians) {
    for cache in machine.caches {
        let found = Agreement::of(machine.rasterizer.as_ref(), *cache, g, &camera(SIDE as u32), BACKGROUND).unwrap();
        println!("{} {cache:?}: {found}", machine.rasterizer.name());
        assert!(found.holds(), "{found}");
    }
}

fn pixel(drawn: &Drawn, x: usize, y: usize) -> [f32; 3] {
    std::array::from_fn(|k| drawn.pixels[3 * (SIDE * y + x) + k])
}

pub fn no_gaussian(machine: &Machine) {
    for degree in 0..=4 {
        empty(machine, &none(degree));
    }
    let refused = ViewSampler::new(&none(0), 1).unwrap_err().to_string();
    assert!(refused.contains("no Gaussians"), "{refused}");
}

pub fn one_gaussian(machine: &Machine) {
    seen(machine, &one(|_| ()));
    agrees(machine, &one(|_| ()));
}

pub fn none_in_view(machine: &Machine) {
    empty(machine, &one(|g| g.positions[0] = [90.0, 0.0, 3.0]));
    empty(machine, &one(|g| g.positions[0] = [0.0, -90.0, 3.0]));
    empty(machine, &one(|g| g.positions[0] = [3e38, -3e38, 3e38]));
}

pub fn all_behind(machine: &Machine) {
    let mut g = ordinary(200, 2);
    for p in &mut g.positions {
        p[2] = -p[2];
    }
    empty(machine, &g);
    // Nothing nearer than the near plane is drawn, and not what lies on it.
    empty(machine, &one(|g| g.positions[0] = [0.0, 0.0, 0.2]));
}

/// The Gaussian around the camera is not drawn, and has a direction all the same; the others are as they were.
pub fn camera_at_a_centre(machine: &Machine) {
    empty(machine, &one(|g| g.positions[0] = [0.0; 3]));
    let mut g = ordinary(100, 2);
    let before = draw(machine, &g);
    g.positions.push([0.0; 3]);
    g.rotations.push([1.0, 0.0, 0.0, 0.0]);
    g.log_scales.push([0.0; 3]);
    g.opacity_logits.push(5.0);
    g.sh.coefficients.extend([1.0; 27]);
    for (before, after) in before.iter().zip(draw(machine, &g)) {
        assert_eq!(before.pixels, after.pixels);
        assert_eq!(before.gradient[..], after.gradient[..2700]);
        assert_eq!(after.gradient[2700..], [0.0; 27]);
    }
}

pub fn zero_quaternions(machine: &Machine) {
    let mut g = ordinary(100, 1);
    g.rotations.fill([0.0; 4]);
    let zero = draw(machine, &g);
    g.rotations.fill([1.0, 0.0, 0.0, 0.0]);
    for (zero, identity) in zero.iter().zip(draw(machine, &g)) {
        assert!(zero.visible > 50);
        assert_eq!(zero.pixels, identity.pixels);
    }
    g.rotations.fill([0.0; 4]);
    agrees(machine, &g);
    // Cameras are placed as for one of identities, too: flat ones tell where the ground is.
    g.log_scales.iter_mut().for_each(|s| s[1] -= 4.0);
    let zero = Extent::of(&g).unwrap();
    g.rotations.fill([1.0, 0.0, 0.0, 0.0]);
    assert_eq!(zero, Extent::of(&g).unwrap());
    // As is what cannot be normalised.
    seen(machine, &one(|g| g.rotations[0] = [f32::INFINITY, 0.0, 0.0, 1.0]));
}

pub fn infinite_opacities(machine: &Machine) {
    for (infinite, limit) in [(f32::INFINITY, 20.0), (f32::NEG_INFINITY, -20.0)] {
        let at = |logit: f32| {
            let g = one(|g| g.opacity_logits[0] = logit);
            draw(machine, &g).remove(0)
        };
        assert_eq!(at(infinite).pixels, at(limit).pixels);
    }
    empty(machine, &one(|g| g.opacity_logits[0] = f32::NEG_INFINITY));
    let opaque = one(|g| {
        g.opacity_logits[0] = f32::INFINITY;
        g.log_scales[0] = [3.0; 3];
        g.sh.coefficients.fill(0.0);
    });
    let drawn = seen(machine, &opaque);
    let want = 0.99 * 0.5 + 0.01 * BACKGROUND[0];
    assert!((drawn.pixels[0] - want).abs() < 1e-5, "alpha is at most 0.99");
    let mut g = ordinary(120, 1);
    for i in (0..120).step_by(3) {
        g.opacity_logits[i] = if i % 2 == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
    }
    agrees(machine, &g);
}

/// A flat axis is one of no thickness; a point is drawn as the low-pass filter makes it, a pixel large.
pub fn flat_axes(machine: &Machine) {
    let drawn = seen(machine, &one(|g| g.log_scales[0] = [f32::NEG_INFINITY; 3]));
    let changed = drawn.pixels.chunks(3).filter(|p| *p != BACKGROUND).count();
    assert!((1..=16).contains(&changed), "{changed} pixels");
    let mut g = ordinary(120, 1);
    for (i, scale) in g.log_scales.iter_mut().enumerate() {
        (0..=i % 3).for_each(|axis| scale[axis] = f32::NEG_INFINITY);
    }
    agrees(machine, &g);
    // Cameras are placed as for discs that are nearly flat.
    let framed = |flat: f32| {
        let mut g = ordinary(120, 0);
        (0..60).for_each(|i| g.log_scales[i][i % 3] = flat);
        Extent::of(&g).unwrap()
    };
    assert_eq!(framed(f32::NEG_INFINITY), framed(-80.0));
}

/// Beyond any scene, and still a picture: what is larger than everything covers all of it alike.
pub fn vast_scales(machine: &Machine) {
    for size in [20.0, 1e30] {
        let drawn = seen(machine, &one(|g| g.log_scales[0] = [size; 3]));
        let first = drawn.pixels[0];
        assert!(drawn.pixels.chunks(3).all(|p| (p[0] - first).abs() < 1e-5));
    }
    // A needle across the universe is one in the picture too: it leaves some of the background.
    let needle = one(|g| {
        g.log_scales[0] = [20.0, -20.0, -20.0];
        g.rotations[0] = [1.0, 0.0, 0.0, 0.4];
    });
    let drawn = seen(machine, &needle);
    let changed = drawn.pixels.chunks(3).filter(|p| *p != BACKGROUND).count();
    assert!((SIDE..6 * SIDE).contains(&changed), "{changed} pixels");
    seen(machine, &one(|g| g.log_scales[0] = [20.0, -20.0, 3.0]));
}

/// Pictures may leave [0, 1], which is for whoever writes or compares them to clamp; below 0 a colour is 0, and has no
/// gradient.
pub fn colours_of_a_million(machine: &Machine) {
    let g = one(|g| {
        g.sh.coefficients.fill(0.0);
        g.sh.coefficients[..3].copy_from_slice(&[1e6, -1e6, 0.0]);
    });
    let drawn = seen(machine, &g);
    let [red, green, _] = pixel(&drawn, SIDE / 2, SIDE / 2);
    assert!(red > 1e5 && (0.0..0.6).contains(&green), "{red} {green}");
    let gradient = &drawn.gradient;
    assert!(gradient[0] > 0.0 && gradient[1] == 0.0 && gradient[2] > 0.0);
    for sign in [1.0, -1.0] {
        let mut g = ordinary(60, 3);
        g.sh.coefficients.iter_mut().for_each(|c| *c = sign * 1e6 * c.signum());
        draw(machine, &g);
    }
}

pub fn degrees(machine: &Machine) {
    for degree in 0..=4 {
        agrees(machine, &ordinary(200, degree));
    }
}

/// The reader refuses them; a scene made in memory may have them.
pub fn not_numbers(machine: &Machine) {
    empty(machine, &one(|g| g.opacity_logits[0] = f32::NAN));
    empty(machine, &one(|g| g.positions[0][1] = f32::NAN));
    empty(machine, &one(|g| g.log_scales[0][1] = f32::NAN));
}
