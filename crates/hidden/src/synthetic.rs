//! Seeded pictures to train and measure on where no scenes are at hand.
use burn::tensor::{Device, Tensor, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::error::{Result, within};
use crate::parameter::{uniform, unit};

/// Endless pictures: smooth fields of colour or a plain background, behind shaded shapes, some of them textured.
#[derive(Clone, Debug)]
pub struct Synthetic {
    side: usize,
    rng: ChaCha8Rng,
}

/// A plane wave: radians a side along y and x, phase and height for each channel.
struct Wave {
    y: f32,
    x: f32,
    phase: f32,
    height: [f32; 3],
}

/// A disc or a rectangle with a shading and perhaps a texture.
struct Shape {
    centre: [f32; 2],
    half: [f32; 2],
    axis: [f32; 2],
    disc: bool,
    colour: [f32; 3],
    shading: Wave,
    texture: Wave,
}

impl Synthetic {
    /// Pictures of `side` pixels both ways; other seeds give other pictures.
    ///
    /// # Errors
    /// [`crate::Error::OutOfRange`] unless `side` is 1 to 4096.
    pub fn new(side: usize, seed: u64) -> Result<Self> {
        within("side", side as f64, 1.0, 4096.0)?;
        Ok(Self {
            side,
            rng: ChaCha8Rng::seed_from_u64(seed),
        })
    }

    /// The next pictures, `[count, 3, side, side]` in [0, 1].
    pub fn next(&mut self, count: usize, device: &Device) -> Tensor<4> {
        let values: Vec<f32> = (0..count).flat_map(|_| self.picture()).collect();
        Tensor::from_data(TensorData::new(values, [count, 3, self.side, self.side]), device)
    }

    /// One picture, a channel after the other.
    fn picture(&mut self) -> Vec<f32> {
        let rng = &mut self.rng;
        let plain = unit(rng) < 0.3;
        let base = match plain {
            true if unit(rng) < 0.5 => [0.0; 3],
            true => [1.0; 3],
            false => colour(rng),
        };
        let waves: Vec<Wave> = (0..if plain { 0 } else { 4 }).map(|_| wave(rng, 9.0, 0.2)).collect();
        let count = 3 + (unit(rng) * 10.0) as usize;
        let shapes: Vec<Shape> = (0..count).map(|_| shape(rng)).collect();
        let grain = if plain { 0.0 } else { uniform(rng, 0.0, 0.02) };
        let side = self.side;
        let mut values = vec![0.0; 3 * side * side];
        for i in 0..side {
            for j in 0..side {
                let (y, x) = ((i as f32 + 0.5) / side as f32, (j as f32 + 0.5) / side as f32);
                let mut pixel = base;
                waves.iter().for_each(|wave| wave.add(&mut pixel, y, x));
                for shape in shapes.iter().filter(|shape| shape.covers(y, x)) {
                    pixel = shape.colour;
                    shape.shading.add(&mut pixel, y, x);
                    shape.texture.add(&mut pixel, y, x);
                }
                let noise = grain * (unit(&mut self.rng) - 0.5);
                for (channel, value) in pixel.into_iter().enumerate() {
                    values[(channel * side + i) * side + j] = (value + noise).clamp(0.0, 1.0);
                }
            }
        }
        values
    }
}

impl Wave {
    fn add(&self, pixel: &mut [f32; 3], y: f32, x: f32) {
        let value = (self.y * y + self.x * x + self.phase).sin();
        pixel.iter_mut().zip(self.height).for_each(|(p, h)| *p += h * value);
    }
}

impl Shape {
    fn covers(&self, y: f32, x: f32) -> bool {
        let (y, x) = (y - self.centre[0], x - self.centre[1]);
        let along = (self.axis[0] * y + self.axis[1] * x) / self.half[0];
        let across = (self.axis[0] * x - self.axis[1] * y) / self.half[1];
        match self.disc {
            true => along * along + across * across <= 1.0,
            false => along.abs() <= 1.0 && across.abs() <= 1.0,
        }
    }
}

fn colour(rng: &mut ChaCha8Rng) -> [f32; 3] {
    std::array::from_fn(|_| uniform(rng, 0.05, 0.95))
}

fn wave(rng: &mut ChaCha8Rng, fastest: f32, highest: f32) -> Wave {
    let grey = uniform(rng, -highest, highest);
    Wave {
        y: uniform(rng, -fastest, fastest),
        x: uniform(rng, -fastest, fastest),
        phase: uniform(rng, 0.0, std::f32::consts::TAU),
        height: std::array::from_fn(|_| 0.7 * grey + 0.3 * uniform(rng, -highest, highest)),
    }
}

fn shape(rng: &mut ChaCha8Rng) -> Shape {
    let angle = uniform(rng, 0.0, std::f32::consts::PI);
    let textured = unit(rng) < 0.4;
    Shape {
        centre: std::array::from_fn(|_| unit(rng)),
        half: std::array::from_fn(|_| uniform(rng, 0.04, 0.35)),
        axis: [angle.sin(), angle.cos()],
        disc: unit(rng) < 0.6,
        colour: colour(rng),
        shading: wave(rng, 8.0, 0.25),
        texture: wave(rng, 150.0, if textured { 0.12 } else { 0.0 }),
    }
}
