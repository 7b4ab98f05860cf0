//! Procedural textures of position: stripes, checks, dots and marble, in random colours.
use rand::{Rng, RngExt};

/// What is drawn.
#[derive(Clone, Copy)]
enum Pattern {
    Stripes,
    Checks,
    Dots,
    Marble,
    Earth,
}

/// A texture of one solid.
pub(super) struct Texture {
    pattern: Pattern,
    colours: [[f32; 3]; 2],
    frequency: f32,
    phase: [f32; 3],
    gloss: f32,
}

impl Texture {
    /// A random texture; that of the ground is duller.
    pub fn random(random: &mut impl Rng, ground: bool) -> Texture {
        let pattern = if ground {
            [Pattern::Earth, Pattern::Checks, Pattern::Marble][random.random_range(0..3)]
        } else {
            [Pattern::Stripes, Pattern::Checks, Pattern::Dots, Pattern::Marble][random.random_range(0..4)]
        };
        let hue = random.random_range(0.0..1.0);
        let (saturation, gloss) = if ground {
            (0.35, 0.05)
        } else {
            (0.8, random.random_range(0.3..0.7))
        };
        // The second colour is across the colour circle and of another lightness.
        let other = hue + random.random_range(0.3..0.7);
        Texture {
            pattern,
            colours: [colour(hue, saturation, 0.85), colour(other, 0.7 * saturation, 0.45)],
            frequency: if ground {
                random.random_range(2.0..3.5)
            } else {
                random.random_range(4.0..7.0)
            },
            phase: std::array::from_fn(|_| random.random_range(0.0..100.0)),
            gloss,
        }
    }

    /// Strength of the highlight.
    pub fn gloss(&self) -> f32 {
        self.gloss
    }

    /// Colour at a point in the solid's own axes, RGB in [0, 1], as pictures have it.
    pub fn colour(&self, p: [f32; 3]) -> [f32; 3] {
        let q: [f32; 3] = std::array::from_fn(|k| p[k] * self.frequency + self.phase[k]);
        let wave = |x: f32| 0.5 + 0.5 * (std::f32::consts::PI * x).sin();
        let t = match self.pattern {
            Pattern::Stripes => edge(wave(q[0] + 0.8 * q[1] + 0.3 * q[2]) - 0.5),
            Pattern::Checks => {
                let sign = |x: f32| (std::f32::consts::PI * x).sin();
                // Offsets keep faces of boxes, where a coordinate is constant, off the zeros.
                edge(8.0 * sign(q[0]) * sign(q[2]) * (sign(0.7 * q[1]).abs() + 0.3) * sign(0.35 * q[1] + 0.2).signum())
            }
            Pattern::Dots => {
                let from_centre = |x: f32| (x - x.floor() - 0.5).powi(2);
                edge(4.0 * (0.16 - q.iter().map(|x| from_centre(*x)).sum::<f32>()))
            }
            Pattern::Marble => wave(q[0] * 0.6 + 3.0 * turbulence(q)).powi(2),
            Pattern::Earth => (1.6 * turbulence(q) - 0.3).clamp(0.0, 1.0),
        };
        let grain = 0.9 + 0.2 * noise(q.map(|x| 6.0 * x));
        std::array::from_fn(|c| (grain * (self.colours[0][c] * t + self.colours[1][c] * (1.0 - t))).clamp(0.0, 1.0))
    }
}

/// A step at 0, softened.
fn edge(x: f32) -> f32 {
    (0.5 + 4.0 * x).clamp(0.0, 1.0)
}

/// RGB of hue (in turns), saturation and value.
fn colour(hue: f32, saturation: f32, value: f32) -> [f32; 3] {
    [0.0, 2.0 / 3.0, 1.0 / 3.0].map(|shift| {
        let distance = ((hue + shift).rem_euclid(1.0) * 6.0 - 3.0).abs() - 1.0;
        value * (1.0 - saturation * (1.0 - distance.clamp(0.0, 1.0)))
    })
}

/// Four octaves of noise, in about [0, 1].
fn turbulence(p: [f32; 3]) -> f32 {
    (0..4)
        .map(|octave| noise(p.map(|x| x * 2f32.powi(octave))) * 0.5f32.powi(octave + 1))
        .sum()
}

/// Smooth value noise in [0, 1]: random values at integer points, blended.
fn noise(p: [f32; 3]) -> f32 {
    let cell = p.map(f32::floor);
    let t: [f32; 3] = std::array::from_fn(|k| {
        let x = p[k] - cell[k];
        x * x * (3.0 - 2.0 * x)
    });
    (0..8)
        .map(|corner| {
            let bit = [corner & 1, corner >> 1 & 1, corner >> 2 & 1];
            let weight: f32 = (0..3).map(|k| if bit[k] == 1 { t[k] } else { 1.0 - t[k] }).product();
            weight * lattice([0, 1, 2].map(|k| cell[k] as i32 + bit[k]))
        })
        .sum()
}

/// A fixed pseudo-random value in [0, 1) at an integer point: the finaliser of SplitMix64.
fn lattice(p: [i32; 3]) -> f32 {
    let mut h = p.iter().fold(0x9E37_79B9_7F4A_7C15u64, |h, x| {
        (h ^ u64::from(*x as u32))
            .wrapping_mul(0xBF58_476D_1CE4_E5B9)
            .rotate_left(31)
    });
    h = (h ^ (h >> 30)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((h ^ (h >> 31)) >> 40) as f32 / 2f32.powi(24)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn textures_have_contrast_and_stay_in_range() {
        for seed in 0..40 {
            let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let texture = Texture::random(&mut random, seed % 4 == 0);
            let (mut least, mut most) = ([1.0f32; 3], [0.0f32; 3]);
            for i in 0..2000 {
                let (sine, cosine) = (i as f32 * 2.4).sin_cos();
                let colour = texture.colour([sine * 0.5, i as f32 / 2000.0 - 0.5, cosine * 0.5]);
                for c in 0..3 {
                    assert!((0.0..=1.0).contains(&colour[c]));
                    (least[c], most[c]) = (least[c].min(colour[c]), most[c].max(colour[c]));
                }
            }
            let contrast = (0..3).map(|c| most[c] - least[c]).fold(0.0, f32::max);
            assert!(contrast > 0.25, "seed {seed}: {contrast}");
        }
    }
}
