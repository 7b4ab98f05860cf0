//! Scenes for the lines: ordinary ones, and each kind of strange Gaussian by itself.
use guardsplat_engine::scene::{Gaussians, Sh};
use guardsplat_engine::view::Camera;

/// What pictures are drawn over where nothing else matters; three different numbers find mixed-up channels.
pub const BACKGROUND: [f32; 3] = [0.2, 0.6, 1.0];

/// A square picture from the origin along +z, 60 degrees wide; all scenes here are in front of it.
pub fn camera(size: u32) -> Camera {
    Camera::look_at([0.0; 3], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], 1.05, size, size)
}

/// `n` Gaussians of all shapes between depths 2 and 6, some of their colours clamped.
pub fn ordinary(n: usize, degree: usize) -> Gaussians {
    let mut state = 7u64;
    let mut random = move |low: f32, high: f32| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut g = none(degree);
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

/// No Gaussian.
pub fn none(degree: usize) -> Gaussians {
    Gaussians {
        sh: Sh {
            degree,
            coefficients: Vec::new(),
        },
        ..Gaussians::default()
    }
}

/// One in the middle of the picture, with `change` done to it.
pub fn one(change: impl FnOnce(&mut Gaussians)) -> Gaussians {
    let mut g = ordinary(1, 1);
    g.positions[0] = [0.0, 0.0, 3.0];
    g.log_scales[0] = [-1.0; 3];
    g.opacity_logits[0] = 2.0;
    change(&mut g);
    g
}

/// A kind of scene whose gradient is checked by itself.
pub type Kind = fn(usize, usize) -> Gaussians;

/// Channels far below 0, which are drawn as 0 and have no gradient, beside bright ones.
pub fn clamped(n: usize, degree: usize) -> Gaussians {
    let mut g = ordinary(n, degree);
    let stride = g.sh.per_gaussian();
    for i in 0..n {
        g.sh.coefficients[i * stride + i % 3] = -6.0;
        g.sh.coefficients[i * stride + (i + 1) % 3] = 3.0;
    }
    g
}

/// Opacities of 1, which are drawn as 0.99, beside ones so faint that their alpha is just above 1/255.
pub fn saturated(n: usize, degree: usize) -> Gaussians {
    let mut g = ordinary(n, degree);
    for (i, logit) in g.opacity_logits.iter_mut().enumerate() {
        *logit = [f32::INFINITY, 20.0, 9.0, -5.3][i % 4];
    }
    g
}

/// A thousand times as long as they are thick.
pub fn needles(n: usize, degree: usize) -> Gaussians {
    let mut g = ordinary(n, degree);
    for (i, scale) in g.log_scales.iter_mut().enumerate() {
        *scale = [-2.5, -9.5, -9.5];
        scale.rotate_right(i % 3);
    }
    g
}

/// Much smaller than a pixel.
pub fn small(n: usize, degree: usize) -> Gaussians {
    let mut g = ordinary(n, degree);
    g.log_scales.fill([-12.0; 3]);
    g
}

/// Everything at once that a file may hold: infinite opacities, flat and vast axes, zero quaternions, colours of a
/// million. The vast ones are faint, or nothing else would be seen.
pub fn strange(n: usize, degree: usize) -> Gaussians {
    let mut g = ordinary(n, degree);
    let stride = g.sh.per_gaussian();
    for i in 0..n {
        match i % 9 {
            0 => g.opacity_logits[i] = f32::INFINITY,
            1 => g.opacity_logits[i] = f32::NEG_INFINITY,
            2 => g.log_scales[i] = [f32::NEG_INFINITY; 3],
            3 => g.log_scales[i][i % 3] = f32::NEG_INFINITY,
            4 => g.rotations[i] = [0.0; 4],
            5 => g.sh.coefficients[i * stride..(i + 1) * stride].fill(1e6),
            6 => g.sh.coefficients[i * stride..(i + 1) * stride].fill(-1e6),
            7 if i < 9 => {
                g.log_scales[i] = [20.0; 3];
                g.opacity_logits[i] = -4.0;
            }
            _ => (),
        }
    }
    g
}

/// `n` balls so large that each touches every tile of a view.
pub fn full_screen(n: usize) -> Gaussians {
    let mut g = none(0);
    g.positions = vec![[0.0, 0.0, 3.0]; n];
    g.rotations = vec![[1.0, 0.0, 0.0, 0.0]; n];
    g.log_scales = vec![[5.0; 3]; n];
    g.opacity_logits = vec![0.0; n];
    g.sh.coefficients = vec![0.0; 3 * n];
    g
}
