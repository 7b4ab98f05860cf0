//! What stands where in each kind of sample: solids on a disc, in a room, on hills, on a stage, on a disc amid a landscape.
use std::f64::consts::TAU;

use rand::{Rng, RngExt};

use super::shapes::{Shape, Solid, hills};
use crate::view::vector::cross;

/// Radius of the ground.
const GROUND: f64 = 1.4;
/// Axes of what is not turned.
const UPRIGHT: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The ground, a solid in its middle and four around, each of another shape; y points down.
pub(super) fn arrange(random: &mut impl Rng) -> Vec<Solid> {
    let mut solids = vec![upright(Shape::Ground { radius: GROUND })];
    solids.extend(things(random, [0.0, 0.9 * GROUND - 0.42]));
    solids
}

/// A shape around the origin that is not turned.
fn upright(shape: Shape) -> Solid {
    Solid {
        shape,
        axes: UPRIGHT,
        centre: [0.0; 3],
    }
}

/// A rectangle of half these sides that faces `inwards`.
fn sheet(half: [f64; 2], inwards: [f32; 3], centre: [f64; 3]) -> Solid {
    // A sheet's normal is its own -y.
    let down = inwards.map(|x| -x);
    let along = if inwards[1] == 0.0 {
        [0.0, 1.0, 0.0]
    } else {
        [1.0, 0.0, 0.0]
    };
    Solid {
        shape: Shape::Sheet { half },
        axes: [along, down, cross(along, down)],
        centre: centre.map(|x| x as f32),
    }
}

/// Four walls that face inwards, so far from the middle and of half this height.
fn walls([a, b]: [f64; 2], high: f64) -> [Solid; 4] {
    [
        sheet([high, b], [-1.0, 0.0, 0.0], [a, -high, 0.0]),
        sheet([high, b], [1.0, 0.0, 0.0], [-a, -high, 0.0]),
        sheet([high, a], [0.0, 0.0, -1.0], [0.0, -high, b]),
        sheet([high, a], [0.0, 0.0, 1.0], [0.0, -high, -b]),
    ]
}

/// Half the sides of a room, and how high it is.
pub(super) const ROOM: [f64; 2] = [2.0, 1.6];
pub(super) const CEILING: f64 = 1.7;

/// A room: floor, ceiling, four walls, and a thing near each wall, each of another shape; y points down.
pub(super) fn furnish(random: &mut impl Rng) -> Vec<Solid> {
    let [a, b] = ROOM;
    let mut solids = vec![
        sheet([a, b], [0.0, -1.0, 0.0], [0.0; 3]),
        sheet([a, b], [0.0, 1.0, 0.0], [0.0, -CEILING, 0.0]),
    ];
    solids.extend(walls(ROOM, 0.5 * CEILING));
    let far = b - 0.45;
    solids.extend(things(random, [far, far]));
    solids
}

/// Half the side of a landscape.
pub(super) const LANDSCAPE: f64 = 2.5;
/// Houses and trees on it.
const HOUSES: usize = 9;
const TREES: usize = 14;

/// Hills with houses and trees on them; y points down.
pub(super) fn landscape(random: &mut impl Rng) -> Vec<Solid> {
    let phase: [f64; 2] = std::array::from_fn(|_| random.random_range(0.0..TAU));
    let mut solids = vec![upright(Shape::Hills { half: LANDSCAPE, phase })];
    for i in 0..HOUSES + TREES {
        let size = random.random_range(0.8..1.25);
        let [x, z]: [f64; 2] = std::array::from_fn(|_| 0.9 * LANDSCAPE * random.random_range(-1.0..1.0));
        let (shape, high) = house_or_tree(i, [0.2 * size, 0.1 * size, 0.13 * size], [0.1, 0.13 * size]);
        // A little in the ground, which is not level under it.
        let (ground, _) = hills(phase, x, z);
        solids.push(Solid {
            shape,
            axes: turned(random.random_range(0.0..TAU)),
            centre: [x, -ground - 0.8 * high, z].map(|x| x as f32),
        });
    }
    solids
}

/// The shape of number `i` of these and half its height: a block of half these sides, or a cone of this radius and half height.
fn house_or_tree(i: usize, house: [f64; 3], [radius, half]: [f64; 2]) -> (Shape, f64) {
    match i < HOUSES {
        true => (Shape::Block { half: house }, house[1]),
        false => (Shape::Cone { radius, half }, half),
    }
}

/// Radii of the ground around the disc, finer and coarser.
const GROUNDS: [f64; 2] = [4.5, 16.0];
/// Half the height of the walls around it, and the radius of the sky.
const WALL: f64 = 3.5;
const SKY: f64 = 45.0;

/// The disc of [`arrange`] in wide ground with houses and trees on it, walls behind these, and the sky.
pub(super) fn surroundings(random: &mut impl Rng) -> Vec<Solid> {
    let [near, far] = GROUNDS;
    let mut solids = arrange(random);
    solids.extend([
        upright(Shape::Ring {
            inner: GROUND,
            outer: near,
        }),
        upright(Shape::Ring {
            inner: near,
            outer: far,
        }),
    ]);
    solids.extend(walls([far; 2], WALL));
    solids.push(upright(Shape::Sphere { radius: SKY }));
    for i in 0..HOUSES + TREES {
        let size = random.random_range(0.8..1.25);
        let (turn, reach): (f64, f64) = (random.random_range(0.0..TAU), random.random_range(5.0..12.0));
        let (shape, high) = house_or_tree(i, [1.6 * size, 0.9 * size, 1.1 * size], [0.9, 1.6 * size]);
        solids.push(Solid {
            shape,
            axes: turned(random.random_range(0.0..TAU)),
            centre: [reach * turn.cos(), -high, reach * turn.sin()].map(|x| x as f32),
        });
    }
    solids
}

/// How coarse a solid of [`surroundings`] is, as trained Gaussians are: in proportion to how far it is from cameras that go
/// around the disc, and 1 there.
pub(super) fn coarseness(solid: &Solid) -> f64 {
    let reach = match solid.shape {
        Shape::Ring { inner, outer } => 0.5 * (inner + outer),
        Shape::Sphere { radius } => radius,
        _ => 0.0,
    };
    let [x, _, z] = solid.centre.map(f64::from);
    (x.hypot(z).max(reach) / GROUND).max(1.0)
}

/// Where the camera stood, in the mean, that captured a stage; it saw nothing that faces away.
pub(super) const STAND: [f32; 3] = [0.0, -1.2, -4.2];
/// Half the width of a stage, how high and how deep it is.
pub(super) const STAGE: [f64; 3] = [1.9, 2.3, 1.8];

/// A stage: a floor, a wall behind it, and things in between; y points down, and its front is at small z.
pub(super) fn stage(random: &mut impl Rng) -> Vec<Solid> {
    let [wide, high, deep] = STAGE;
    let floor = upright(Shape::Sheet {
        half: [wide, 0.5 * deep],
    });
    // The wall's own -y looks to the front.
    let wall = Solid {
        shape: Shape::Sheet {
            half: [wide, 0.5 * high],
        },
        axes: [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]],
        centre: [0.0, -0.5 * high, 0.5 * deep].map(|x| x as f32),
    };
    let mut solids = vec![floor, wall];
    let mut things = things(random, [0.0, 0.5]);
    for (i, thing) in things.iter_mut().enumerate() {
        // Side by side, every second one a little farther back.
        let beside = (i as f64 - 2.0) * 0.36 * wide;
        thing.centre[0] = beside as f32;
        thing.centre[2] = if i % 2 == 0 { -0.25 } else { 0.3 } * deep as f32;
    }
    solids.extend(things);
    solids
}

/// A solid of each shape around the middle, the first and the others so far away.
fn things(random: &mut impl Rng, reaches: [f64; 2]) -> Vec<Solid> {
    let size: [f64; 5] = std::array::from_fn(|_| random.random_range(0.85..1.15));
    let mut shapes = [
        Shape::Sphere { radius: 0.34 * size[0] },
        Shape::Torus {
            ring: 0.28 * size[1],
            tube: 0.12 * size[1],
        },
        Shape::Block {
            half: [0.24 * size[2], 0.3 * size[2], 0.2],
        },
        Shape::Cylinder {
            radius: 0.19,
            half: 0.42 * size[3],
        },
        Shape::Cone {
            radius: 0.3,
            half: 0.36 * size[4],
        },
    ];
    // Fisher-Yates; the first then stands in the middle.
    for i in (1..shapes.len()).rev() {
        shapes.swap(i, random.random_range(0..=i));
    }
    let start = random.random_range(0.0..TAU);
    let turn_of_each = if reaches[0] == 0.0 { 0.25 * TAU } else { 0.2 * TAU };
    let mut solids = Vec::new();
    for (i, shape) in shapes.into_iter().enumerate() {
        let angle = start + turn_of_each * i as f64 + random.random_range(-0.15..0.15);
        let reach = reaches[usize::from(i > 0)];
        let turn = random.random_range(0.0..TAU);
        let (axes, height) = match shape {
            Shape::Ground { .. } | Shape::Ring { .. } | Shape::Sheet { .. } | Shape::Hills { .. } => (UPRIGHT, 0.0),
            Shape::Sphere { radius } => (turned(turn), radius),
            // The ring stands on its rim, so that one sees through it.
            Shape::Torus { ring, tube } => (on_edge(turn), ring + tube),
            Shape::Block { half } => (turned(turn), half[1]),
            Shape::Cylinder { half, .. } | Shape::Cone { half, .. } => (turned(turn), half),
        };
        let centre = [reach * angle.cos(), -height, reach * angle.sin()].map(|x| x as f32);
        solids.push(Solid { shape, axes, centre });
    }
    solids
}

/// Axes turned about the vertical.
fn turned(angle: f64) -> [[f32; 3]; 3] {
    let (s, c) = (angle.sin() as f32, angle.cos() as f32);
    [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
}

/// Axes with the y axis level.
fn on_edge(angle: f64) -> [[f32; 3]; 3] {
    let [level, down, _] = turned(angle);
    [down, level, cross(down, level)]
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::view::vector::dot;

    #[test]
    fn everything_stands_on_the_ground() {
        for seed in 0..20 {
            for solid in arrange(&mut rand_chacha::ChaCha8Rng::seed_from_u64(seed)) {
                let mut lowest = f32::NEG_INFINITY;
                for i in 0..2000 {
                    let (p, normal) = solid.point(f64::from(i) / 2000.0, f64::from(i) * 0.618 % 1.0);
                    lowest = lowest.max(p[1]);
                    assert!(p[0].hypot(p[2]) < GROUND as f32 + 0.01);
                    assert!((dot(normal, normal) - 1.0).abs() < 1e-4);
                }
                assert!(lowest.abs() < 0.01, "{lowest}");
            }
        }
    }
}
