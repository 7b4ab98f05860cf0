//! Spherical harmonics turned: coefficients of a node's space as those of the world, and back.
//!
//! Bands do not mix, and a turn of a band is an orthogonal matrix: its inverse is its transpose. Matrices are made from
//! that of the turn, band by band, by the recursion of Ivanic and Ruedenberg (J. Phys. Chem. 1996, 100, 6342, with the
//! correction of 1998), in double precision. Their harmonics have no Condon-Shortley phase and ours do, so that entries
//! whose orders differ by an odd number change their sign.
use crate::MAX_DEGREE;

/// Rows are x, y, z.
pub(crate) type Matrix = [[f64; 3]; 3];

/// A turn of spherical harmonics.
#[derive(Clone, Debug)]
pub(crate) struct Turn {
    /// Of band `l`, at `l - 1`: `(2 l + 1)^2` entries, row by row.
    bands: Vec<Vec<f64>>,
}

impl Turn {
    /// Turns by a matrix of determinant 1, which takes directions of the node's space to those of the world.
    pub fn new(rotation: &Matrix) -> Turn {
        // Orders -1, 0 and 1 are y, z and x.
        let axis = [1, 2, 0];
        let first: Vec<f64> = (0..9).map(|i| rotation[axis[i / 3]][axis[i % 3]]).collect();
        let mut bands = vec![first];
        for l in 2..=MAX_DEGREE as i64 {
            let band = Recursion {
                first: &bands[0],
                previous: &bands[l as usize - 2],
                l,
            };
            bands.push(band.next());
        }
        for (i, band) in bands.iter_mut().enumerate() {
            let width = 2 * i + 3;
            for (place, entry) in band.iter_mut().enumerate() {
                if (place / width + place % width) % 2 == 1 {
                    *entry = -*entry;
                }
            }
        }
        Turn { bands }
    }

    /// The coefficients of band `l` of a Gaussian, `[2 l + 1][3]`, from the node's space to the world.
    pub fn to_world(&self, l: usize, band: &mut [f32]) {
        let (width, matrix) = (2 * l + 1, &self.bands[l - 1]);
        multiply(width, |m, n| matrix[m * width + n], band);
    }

    /// Those of the world in the node's space.
    pub fn to_node(&self, l: usize, band: &mut [f32]) {
        let (width, matrix) = (2 * l + 1, &self.bands[l - 1]);
        multiply(width, |m, n| matrix[n * width + m], band);
    }
}

/// Numbers whose turn single precision has no place for get its ends: colours are finite.
fn multiply(width: usize, matrix: impl Fn(usize, usize) -> f64, band: &mut [f32]) {
    let mut turned = [0.0f32; 3 * (2 * MAX_DEGREE + 1)];
    for m in 0..width {
        for channel in 0..3 {
            let sum: f64 = (0..width)
                .map(|n| matrix(m, n) * f64::from(band[3 * n + channel]))
                .sum();
            turned[3 * m + channel] = (sum as f32).clamp(f32::MIN, f32::MAX);
        }
    }
    band.copy_from_slice(&turned[..3 * width]);
}

/// What band `l` is made of. Orders `m` and `n` go from `-l` to `l`; names are those of the paper.
struct Recursion<'a> {
    first: &'a [f64],
    previous: &'a [f64],
    l: i64,
}

impl Recursion<'_> {
    fn next(&self) -> Vec<f64> {
        let l = self.l;
        let entries = (-l..=l).flat_map(|m| (-l..=l).map(move |n| (m, n)));
        entries.map(|(m, n)| self.entry(m, n)).collect()
    }

    fn entry(&self, m: i64, n: i64) -> f64 {
        let l = self.l;
        let below = if n.abs() == l {
            2 * l * (2 * l - 1)
        } else {
            (l + n) * (l - n)
        };
        let root = |above: i64| (above as f64 / below as f64).sqrt();
        let zero = m == 0;
        let u = root((l + m) * (l - m));
        let v = match zero {
            true => -0.5 * root(2 * (l - 1) * l),
            false => 0.5 * root((l + m.abs() - 1) * (l + m.abs())),
        };
        let w = if zero {
            0.0
        } else {
            -0.5 * root((l - m.abs() - 1) * (l - m.abs()))
        };
        // What a factor of 0 is multiplied with need not exist.
        let term = |factor: f64, value: &dyn Fn() -> f64| if factor == 0.0 { 0.0 } else { factor * value() };
        term(u, &|| self.p(0, m, n)) + term(v, &|| self.v(m, n)) + term(w, &|| self.w(m, n))
    }

    fn first(&self, m: i64, n: i64) -> f64 {
        self.first[((m + 1) * 3 + n + 1) as usize]
    }

    fn previous(&self, m: i64, n: i64) -> f64 {
        let before = self.l - 1;
        self.previous[((m + before) * (2 * before + 1) + n + before) as usize]
    }

    fn p(&self, i: i64, m: i64, n: i64) -> f64 {
        let l = self.l;
        let ends = |sign: f64, a: i64, b: i64| {
            self.first(i, 1) * self.previous(m, a) + sign * self.first(i, -1) * self.previous(m, b)
        };
        match n {
            n if n == l => ends(-1.0, l - 1, 1 - l),
            n if n == -l => ends(1.0, 1 - l, l - 1),
            n => self.first(i, 0) * self.previous(m, n),
        }
    }

    fn v(&self, m: i64, n: i64) -> f64 {
        let root = std::f64::consts::SQRT_2;
        match m {
            0 => self.p(1, 1, n) + self.p(-1, -1, n),
            1 => self.p(1, 0, n) * root,
            -1 => self.p(-1, 0, n) * root,
            m if m > 0 => self.p(1, m - 1, n) - self.p(-1, 1 - m, n),
            m => self.p(1, m + 1, n) + self.p(-1, -m - 1, n),
        }
    }

    fn w(&self, m: i64, n: i64) -> f64 {
        match m {
            m if m > 0 => self.p(1, m + 1, n) + self.p(-1, -m - 1, n),
            m => self.p(1, m - 1, n) - self.p(-1, 1 - m, n),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The functions of degree 1 to 3 as the extension lists them.
    fn basis([x, y, z]: [f64; 3]) -> [f64; 15] {
        let (xx, yy, zz) = (x * x, y * y, z * z);
        [
            -0.488_602_511_902_919_9 * y,
            0.488_602_511_902_919_9 * z,
            -0.488_602_511_902_919_9 * x,
            1.092_548_430_592_079 * x * y,
            -1.092_548_430_592_079 * y * z,
            0.315_391_565_252_52 * (2.0 * zz - xx - yy),
            -1.092_548_430_592_079 * x * z,
            0.546_274_215_296_039_5 * (xx - yy),
            -0.590_043_589_926_643_5 * y * (3.0 * xx - yy),
            2.890_611_442_640_554 * x * y * z,
            -0.457_045_799_464_465_7 * y * (4.0 * zz - xx - yy),
            0.373_176_332_590_115_4 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy),
            -0.457_045_799_464_465_7 * x * (4.0 * zz - xx - yy),
            1.445_305_721_320_277 * z * (xx - yy),
            -0.590_043_589_926_643_5 * x * (xx - 3.0 * yy),
        ]
    }

    fn unit() -> impl Strategy<Value = [f64; 4]> {
        prop::array::uniform4(-1.0..1.0f64).prop_filter_map("some length", |q| {
            let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            (length > 0.1).then(|| q.map(|v| v / length))
        })
    }

    #[test]
    fn half_a_turn_changes_signs_only() {
        let turn = Turn::new(&[[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
        for l in 1..=MAX_DEGREE {
            let band: Vec<f32> = (0..3 * (2 * l + 1)).map(|i| i as f32 * 0.1 - 1.3).collect();
            let mut turned = band.clone();
            turn.to_world(l, &mut turned);
            for (a, b) in band.iter().zip(&turned) {
                assert_eq!(a.abs().to_bits(), b.abs().to_bits(), "band {l}");
            }
            turn.to_node(l, &mut turned);
            assert_eq!(turned, band);
        }
    }

    proptest! {
        #[test]
        fn turned_harmonics_look_the_same_from_turned_directions(q in unit(), d in unit(), seed in -1.0..1.0f32) {
            let rotation = crate::gltf::placement::matrix(q);
            let turn = Turn::new(&rotation);
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt().max(1e-9);
            let d = [d[0] / length, d[1] / length, d[2] / length];
            let world: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| rotation[i][j] * d[j]).sum());
            let node: Vec<f32> = (0..45).map(|i| ((i as f32 + 1.0) * (seed + 2.0)).sin()).collect();
            let mut there = node.clone();
            for (l, range) in [(1, 0..9), (2, 9..24), (3, 24..45)] {
                turn.to_world(l, &mut there[range]);
            }
            for channel in 0..3 {
                let seen = |band: &[f32], d| -> f64 {
                    basis(d).iter().enumerate().map(|(i, y)| y * f64::from(band[3 * i + channel])).sum()
                };
                prop_assert!((seen(&node, d) - seen(&there, world)).abs() < 1e-5);
            }
            for (l, range) in [(1, 0..9), (2, 9..24), (3, 24..45)] {
                turn.to_node(l, &mut there[range]);
            }
            for (a, b) in node.iter().zip(&there) {
                prop_assert!((a - b).abs() < 1e-5);
            }
        }

        #[test]
        fn bands_of_degree_four_are_turned_orthogonally(q in unit()) {
            let band = &Turn::new(&crate::gltf::placement::matrix(q)).bands[3];
            for a in 0..9 {
                for b in 0..9 {
                    let product: f64 = (0..9).map(|i| band[9 * a + i] * band[9 * b + i]).sum();
                    prop_assert!((product - f64::from(u8::from(a == b))).abs() < 1e-12);
                }
            }
        }
    }
}
