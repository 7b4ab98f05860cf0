//! Solids with area-preserving parametrisations of their surfaces.
use crate::view::vector::{dot, unit};
use std::f64::consts::{PI, TAU};

/// A shape around the origin, before it is turned and moved; lengths in world units, axis along y.
#[derive(Clone, Copy)]
pub(super) enum Shape {
    /// Level disc; its underside is the same Gaussians.
    Ground {
        radius: f64,
    },
    /// Level ring, its inner and outer radius.
    Ring {
        inner: f64,
        outer: f64,
    },
    /// A rectangle, seen from above: half its sides.
    Sheet {
        half: [f64; 2],
    },
    /// Low hills on a square, half its side; nearly area-preserving, as they are not steep.
    Hills {
        half: f64,
        phase: [f64; 2],
    },
    Sphere {
        radius: f64,
    },
    /// Radius of the ring and of its tube.
    Torus {
        ring: f64,
        tube: f64,
    },
    /// Half the sides.
    Block {
        half: [f64; 3],
    },
    Cylinder {
        radius: f64,
        half: f64,
    },
    /// Apex upwards (at `-half`), base below.
    Cone {
        radius: f64,
        half: f64,
    },
}

/// A shape in its place.
pub(super) struct Solid {
    pub shape: Shape,
    /// Own axes in the world.
    pub axes: [[f32; 3]; 3],
    pub centre: [f32; 3],
}

impl Solid {
    /// Surface area.
    pub fn area(&self) -> f64 {
        match self.shape {
            Shape::Ground { radius } => PI * radius * radius,
            Shape::Ring { inner, outer } => PI * (outer * outer - inner * inner),
            Shape::Sheet { half: [a, b] } => 4.0 * a * b,
            Shape::Hills { half, .. } => 4.0 * half * half,
            Shape::Sphere { radius } => 4.0 * PI * radius * radius,
            Shape::Torus { ring, tube } => TAU * ring * TAU * tube,
            Shape::Block { half: [a, b, c] } => 8.0 * (a * b + b * c + c * a),
            Shape::Cylinder { radius, half } => TAU * radius * (radius + 2.0 * half),
            Shape::Cone { radius, half } => PI * radius * (radius + radius.hypot(2.0 * half)),
        }
    }

    /// Whether this is the ground.
    pub fn is_ground(&self) -> bool {
        matches!(
            self.shape,
            Shape::Ground { .. } | Shape::Ring { .. } | Shape::Sheet { .. } | Shape::Hills { .. }
        )
    }

    /// The point and outward unit normal for `u`, `v` in [0, 1): even in the square is even on the surface.
    pub fn point(&self, u: f64, v: f64) -> ([f32; 3], [f32; 3]) {
        let (point, normal) = surface(self.shape, u, v);
        let place =
            |p: [f64; 3]| -> [f32; 3] { std::array::from_fn(|k| (0..3).map(|a| p[a] as f32 * self.axes[a][k]).sum()) };
        let normal = unit(place(normal)).unwrap_or([0.0, -1.0, 0.0]);
        let point = place(point);
        (std::array::from_fn(|k| point[k] + self.centre[k]), normal)
    }

    /// A world point in the solid's own axes.
    pub fn to_own_axes(&self, p: [f32; 3]) -> [f32; 3] {
        let from_centre = std::array::from_fn(|k| p[k] - self.centre[k]);
        self.axes.map(|axis| dot(axis, from_centre))
    }
}

/// Height of the hills above their plane, and how it grows along x and z.
pub(super) fn hills(phase: [f64; 2], x: f64, z: f64) -> (f64, [f64; 2]) {
    let waves = [
        (0.16, 1.1, 0.5, phase[0]),
        (0.11, -0.7, 1.4, phase[1]),
        (0.04, 2.3, 2.1, phase[0] + phase[1]),
    ];
    let (mut height, mut slope) = (0.0, [0.0; 2]);
    for (high, a, b, phase) in waves {
        let (sine, cosine) = (a * x + b * z + phase).sin_cos();
        height += high * sine;
        slope[0] += high * a * cosine;
        slope[1] += high * b * cosine;
    }
    (height, slope)
}

fn surface(shape: Shape, u: f64, v: f64) -> ([f64; 3], [f64; 3]) {
    let (sine, cosine) = (TAU * v).sin_cos();
    // A disc of area-preserving radius at height y.
    let disc = |radius: f64, share: f64, y: f64| [radius * share.sqrt() * cosine, y, radius * share.sqrt() * sine];
    match shape {
        Shape::Ground { radius } => (disc(radius, u, 0.0), [0.0, -1.0, 0.0]),
        Shape::Ring { inner, outer } => {
            let radius = (inner * inner + u * (outer * outer - inner * inner)).sqrt();
            (disc(radius, 1.0, 0.0), [0.0, -1.0, 0.0])
        }
        Shape::Sheet { half: [a, b] } => ([a * (2.0 * u - 1.0), 0.0, b * (2.0 * v - 1.0)], [0.0, -1.0, 0.0]),
        Shape::Hills { half, phase } => {
            let [x, z] = [u, v].map(|t| half * (2.0 * t - 1.0));
            let (height, [along_x, along_z]) = hills(phase, x, z);
            let length = (1.0 + along_x * along_x + along_z * along_z).sqrt();
            ([x, -height, z], [-along_x, -1.0, -along_z].map(|n| n / length))
        }
        Shape::Sphere { radius } => {
            let y = 1.0 - 2.0 * u;
            let level = (1.0 - y * y).max(0.0).sqrt();
            let normal = [level * cosine, y, level * sine];
            (normal.map(|x| radius * x), normal)
        }
        Shape::Torus { ring, tube } => {
            // Around the tube the density is 1 + (tube / ring) cos t: Newton inverts its integral.
            let goal = TAU * u;
            let mut t = goal;
            for _ in 0..8 {
                t -= (t + tube / ring * t.sin() - goal) / (1.0 + tube / ring * t.cos());
            }
            let normal = [t.cos() * cosine, t.sin(), t.cos() * sine];
            (
                [
                    cosine * ring + tube * normal[0],
                    tube * normal[1],
                    sine * ring + tube * normal[2],
                ],
                normal,
            )
        }
        Shape::Block { half } => {
            let faces = [half[1] * half[2], half[2] * half[0], half[0] * half[1]];
            let mut left = 2.0 * u * faces.iter().sum::<f64>();
            let mut face = 0;
            while face < 5 && left >= faces[face / 2] {
                left -= faces[face / 2];
                face += 1;
            }
            let (axis, side) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let (mut point, mut normal) = ([0.0; 3], [0.0; 3]);
            normal[axis] = side;
            point[axis] = side * half[axis];
            point[a] = half[a] * (2.0 * (left / faces[axis]).min(1.0) - 1.0);
            point[b] = half[b] * (2.0 * v - 1.0);
            (point, normal)
        }
        Shape::Cylinder { radius, half } => {
            let ends = radius / (2.0 * radius + 4.0 * half);
            if u < ends {
                (disc(radius, u / ends, half), [0.0, 1.0, 0.0])
            } else if u < 2.0 * ends {
                (disc(radius, u / ends - 1.0, -half), [0.0, -1.0, 0.0])
            } else {
                let y = half * (2.0 * (u - 2.0 * ends) / (1.0 - 2.0 * ends) - 1.0);
                ([radius * cosine, y, radius * sine], [cosine, 0.0, sine])
            }
        }
        Shape::Cone { radius, half } => {
            // y points down: the base is at +half.
            let side = radius.hypot(2.0 * half);
            let base = radius / (radius + side);
            if u < base {
                (disc(radius, u / base, half), [0.0, 1.0, 0.0])
            } else {
                let share = (u - base) / (1.0 - base);
                let y = half * (2.0 * share.sqrt() - 1.0);
                let normal = [2.0 * half / side * cosine, -radius / side, 2.0 * half / side * sine];
                (disc(radius, share, y), normal)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::arrange::arrange;
    use rand::SeedableRng;

    #[test]
    fn points_are_on_the_solid_and_spread_by_area() {
        let solids = arrange(&mut rand_chacha::ChaCha8Rng::seed_from_u64(1));
        assert_eq!(solids.len(), 6);
        for solid in &solids {
            let (n, e) = (40, 1e-4);
            for i in 0..n * n {
                let (u, v) = (
                    (f64::from(i / n) + 0.37) / f64::from(n),
                    (f64::from(i % n) + 0.41) / f64::from(n),
                );
                let at = |u: f64, v: f64| surface(solid.shape, u, v);
                let ((p, normal), (a, _), (b, _)) = (at(u, v), at(u + e, v), at(u, v + e));
                let (a, b): ([f64; 3], [f64; 3]) = (
                    std::array::from_fn(|k| (a[k] - p[k]) / e),
                    std::array::from_fn(|k| (b[k] - p[k]) / e),
                );
                let c = [
                    a[1] * b[2] - a[2] * b[1],
                    a[2] * b[0] - a[0] * b[2],
                    a[0] * b[1] - a[1] * b[0],
                ];
                let stretch = c.iter().map(|x| x * x).sum::<f64>().sqrt();
                // Steps across an edge have no tangent.
                if stretch < 3.0 * solid.area() {
                    assert!(
                        (stretch / solid.area() - 1.0).abs() < 0.01,
                        "{}",
                        stretch / solid.area()
                    );
                    let along: f64 = (0..3).map(|k| c[k] * normal[k]).sum();
                    assert!((along.abs() / stretch - 1.0).abs() < 1e-3);
                }
            }
        }
    }
}
