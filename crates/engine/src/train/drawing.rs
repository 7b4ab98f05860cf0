//! Drawings: overlapping textured shapes on a plain or textured ground, and random views of them.
//!
//! Overlapping shapes of many sizes (dead leaves) with fractal textures have the statistics of natural pictures; the
//! mask tells the shapes from the ground, because a mark stands only on the object.
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::PI;

/// Side of a drawing in pixels.
pub const SIDE: usize = 256;
const AREA: usize = SIDE * SIDE;

/// A drawing: four planes of `SIDE * SIDE`, red, green, blue in [0, 1] and the mask of the object.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Planar values.
    pub planes: Vec<f32>,
}

/// The drawing with this number in the stream of `seed`.
pub fn draw(seed: u64, index: u64) -> Drawing {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    let textures: Vec<Vec<f32>> = (0..3).map(|_| texture(&mut rng)).collect();
    let mut planes = vec![0.0; 4 * AREA];
    ground(&mut planes, &textures[0], &mut rng);
    let fills_picture = rng.random_bool(0.25);
    let spread = if fills_picture { 0.5 } else { 0.28 };
    let largest = rng.random_range(0.15..0.45_f32);
    for shape in 0..rng.random_range(3..24) {
        let radius = match shape {
            0 => largest,
            _ => largest * (0.9 * rng.random::<f32>().powf(1.5) + 0.06),
        };
        let reach = if shape == 0 { 0.3 * spread } else { spread };
        let texture = &textures[rng.random_range(0..textures.len())];
        Shape::random(radius, reach, &mut rng).fill(&mut planes, texture, &textures[1]);
    }
    if fills_picture {
        planes[3 * AREA..].fill(1.0);
    }
    Drawing { planes }
}

/// White, black, one colour, or a faint texture.
fn ground(planes: &mut [f32], texture: &[f32], rng: &mut impl Rng) {
    let kind = rng.random_range(0..4);
    let colour: [f32; 3] = match kind {
        0 => [f32::from(rng.random_range(0..2_u8)); 3],
        1 => [1.0; 3],
        _ => std::array::from_fn(|_| rng.random()),
    };
    let contrast = if kind == 3 { 0.15 } else { 0.0 };
    for c in 0..3 {
        for p in 0..AREA {
            planes[c * AREA + p] = (colour[c] + contrast * texture[c * AREA + p]).clamp(0.0, 1.0);
        }
    }
}

/// A shape and how it is painted.
struct Shape {
    centre: [f32; 2],
    radius: f32,
    axis: [f32; 2],
    flatness: f32,
    round: bool,
    ragged: f32,
    colour: [f32; 3],
    contrast: f32,
    shade: [f32; 2],
    roll: usize,
}

impl Shape {
    fn random(radius: f32, reach: f32, rng: &mut impl Rng) -> Self {
        let angle = rng.random_range(0.0..PI);
        Self {
            centre: std::array::from_fn(|_| rng.random_range(-reach..reach)),
            radius,
            axis: [angle.cos(), angle.sin()],
            flatness: rng.random_range(0.35..1.0),
            round: rng.random_bool(0.6),
            ragged: if rng.random_bool(0.3) { 0.03 } else { 0.0 },
            colour: std::array::from_fn(|_| rng.random()),
            contrast: rng.random_range(0.0..0.22),
            shade: std::array::from_fn(|_| rng.random_range(-0.5..0.5)),
            roll: rng.random_range(0..AREA),
        }
    }

    fn fill(&self, planes: &mut [f32], texture: &[f32], edge: &[f32]) {
        for p in 0..AREA {
            let x = (p % SIDE) as f32 / SIDE as f32 - 0.5 - self.centre[0];
            let y = (p / SIDE) as f32 / SIDE as f32 - 0.5 - self.centre[1];
            let u = x * self.axis[0] + y * self.axis[1];
            let v = (y * self.axis[0] - x * self.axis[1]) / self.flatness;
            let distance = if self.round { u.hypot(v) } else { u.abs().max(v.abs()) };
            if distance + self.ragged * edge[p] >= self.radius {
                continue;
            }
            let light = 1.0 + (self.shade[0] * u + self.shade[1] * v) / self.radius;
            for c in 0..3 {
                let grain = texture[c * AREA + (p + self.roll) % AREA];
                planes[c * AREA + p] = ((self.colour[c] + self.contrast * grain) * light).clamp(0.0, 1.0);
            }
            planes[3 * AREA + p] = 1.0;
        }
    }
}

/// Fractal noise of unit deviation in three correlated channels: octaves of smooth noise whose strength falls with
/// frequency by a random power, as in natural pictures.
fn texture(rng: &mut impl Rng) -> Vec<f32> {
    let power = rng.random_range(0.3..1.3_f32);
    let mut channels = vec![0.0; 3 * AREA];
    for channel in channels.chunks_exact_mut(AREA) {
        for cell in [128, 64, 32, 16, 8, 4, 2, 1] {
            octave(channel, cell, (cell as f32).powf(power), rng);
        }
    }
    let common = 0.6 * symmetric(rng);
    let mix: [[f32; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| common + 0.5 * symmetric(rng)));
    let mut out = vec![0.0; 3 * AREA];
    for p in 0..AREA {
        for c in 0..3 {
            out[c * AREA + p] = (0..3).map(|k| mix[c][k] * channels[k * AREA + p]).sum();
        }
    }
    let mean = out.iter().sum::<f32>() / out.len() as f32;
    let variance = out.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / out.len() as f32;
    out.iter_mut()
        .for_each(|v| *v = (*v - mean) / variance.sqrt().max(1e-6));
    out
}

/// Adds smooth noise with a random value every `cell` pixels.
fn octave(channel: &mut [f32], cell: usize, strength: f32, rng: &mut impl Rng) {
    let columns = SIDE / cell + 2;
    let values: Vec<f32> = (0..columns * columns).map(|_| strength * symmetric(rng)).collect();
    for (p, out) in channel.iter_mut().enumerate() {
        let (x, y) = (p % SIDE, p / SIDE);
        let (fx, fy) = ((x % cell) as f32 / cell as f32, (y % cell) as f32 / cell as f32);
        let at = y / cell * columns + x / cell;
        let upper = values[at] * (1.0 - fx) + values[at + 1] * fx;
        let lower = values[at + columns] * (1.0 - fx) + values[at + columns + 1] * fx;
        *out += upper * (1.0 - fy) + lower * fy;
    }
}

fn symmetric(rng: &mut impl Rng) -> f32 {
    rng.random_range(-1.0..1.0)
}

/// A random view, `size * size` pixels in three planes: turned, scaled, moved and lit otherwise, with a little noise.
/// Also the mask, one plane.
pub fn random_view(drawing: &Drawing, size: usize, rng: &mut impl Rng) -> (Vec<f32>, Vec<f32>) {
    let angle = 0.5 * symmetric(rng);
    let scale = (0.35 * symmetric(rng)).exp() * 0.85 * SIDE as f32 / size as f32;
    let stretch = (0.15 * symmetric(rng)).exp();
    let shift = [0.1, 0.1].map(|s| s * SIDE as f32 * symmetric(rng));
    let (cos, sin) = (scale * angle.cos(), scale * angle.sin());
    let light = 1.0 + 0.3 * symmetric(rng);
    let noise = 0.02 * rng.random::<f32>();
    let (mut view, mut mask) = (vec![0.0; 3 * size * size], vec![0.0; size * size]);
    for p in 0..size * size {
        let x = (p % size) as f32 + 0.5 - 0.5 * size as f32;
        let y = (p / size) as f32 + 0.5 - 0.5 * size as f32;
        let at = [
            stretch * cos * x - sin * y + shift[0],
            sin * x + cos / stretch * y + shift[1],
        ];
        let at = at.map(|v| v + 0.5 * SIDE as f32 - 0.5);
        for c in 0..3 {
            let value = light * bilinear(&drawing.planes[c * AREA..(c + 1) * AREA], at) + noise * symmetric(rng);
            view[c * size * size + p] = value.clamp(0.0, 1.0);
        }
        mask[p] = bilinear(&drawing.planes[3 * AREA..], at);
    }
    (view, mask)
}

/// The value between pixels; beyond the border, the border's.
fn bilinear(plane: &[f32], at: [f32; 2]) -> f32 {
    let last = (SIDE - 1) as f32;
    let [x, y] = at.map(|v| v.clamp(0.0, last));
    let (x0, y0) = ((x as usize).min(SIDE - 2), (y as usize).min(SIDE - 2));
    let (fx, fy) = (x - x0 as f32, y - y0 as f32);
    let row = |y: usize| plane[y * SIDE + x0] * (1.0 - fx) + plane[y * SIDE + x0 + 1] * fx;
    row(y0) * (1.0 - fy) + row(y0 + 1) * fy
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawings_are_seeded_and_differ() {
        let (a, b) = (draw(3, 5), draw(3, 6));
        assert_eq!(a, draw(3, 5));
        assert_ne!(a, b);
        for drawing in [&a, &b] {
            assert!(drawing.planes.iter().all(|v| (0.0..=1.0).contains(v)));
            let object = drawing.planes[3 * AREA..].iter().sum::<f32>() / AREA as f32;
            assert!(object > 0.01, "{object}");
        }
    }

    #[test]
    fn a_view_without_change_is_the_drawing() {
        let drawing = draw(1, 2);
        let plane = &drawing.planes[..AREA];
        for p in [0, 7, 5000, AREA - 1] {
            let at = [(p % SIDE) as f32, (p / SIDE) as f32];
            assert!((bilinear(plane, at) - plane[p]).abs() < 1e-6);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (view, mask) = random_view(&drawing, 96, &mut rng);
        assert_eq!((view.len(), mask.len()), (3 * 96 * 96, 96 * 96));
        assert!(view.iter().chain(&mask).all(|v| (0.0..=1.0).contains(v)));
    }
}
