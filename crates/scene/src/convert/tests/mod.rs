//! Tests of conversion, the scenes that they convert, and what a format may do to a number.
mod bounds;
mod edges;
mod real;
mod round_trips;

use super::*;
use crate::{HEAD, Scene, Sh, sniff};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A scene without a pattern whose numbers are those of captured ones, flat axes and infinite opacities among them.
pub(crate) fn random(rows: usize, degree: usize, seed: u64) -> Gaussians {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut scene = Gaussians::default();
    scene.sh.degree = degree;
    for row in 0..rows {
        let mut number = |size: f32| random.random_range(-size..size);
        // Most near the middle, some far away.
        scene
            .positions
            .push(std::array::from_fn(|_| number(1.0) * number(3.0).exp()));
        scene.rotations.push(std::array::from_fn(|_| number(2.0)));
        scene.log_scales.push(std::array::from_fn(|_| -4.0 + number(4.0)));
        scene.opacity_logits.push(number(8.0));
        let coefficients = (0..scene.sh.per_gaussian()).map(|place| if place < 3 { number(1.7) } else { number(0.6) });
        scene.sh.coefficients.extend(coefficients);
        if row % 50 == 7 {
            scene.log_scales[row][row % 3] = f32::NEG_INFINITY;
        }
        match row % 60 {
            11 => scene.opacity_logits[row] = f32::INFINITY,
            12 => scene.opacity_logits[row] = f32::NEG_INFINITY,
            13 => scene.rotations[row] = [0.0; 4],
            14 => scene.rotations[row] = [-0.5; 4],
            _ => (),
        }
    }
    scene
}

/// A file that was written, and what reading it gives.
struct File {
    bytes: Vec<u8>,
    written: Written,
    scene: Scene,
}

fn converted(scene: &Gaussians, format: Format) -> File {
    let mut bytes = Vec::new();
    let written = convert(scene, format, Path::new("test"), &mut bytes).unwrap();
    assert_eq!(written.format, format);
    let head = &bytes[..bytes.len().min(HEAD)];
    assert_eq!(sniff(head, bytes.len() as u64), Some(format));
    let read = Scene::parse(Path::new("test"), &bytes).unwrap();
    assert_eq!((read.format(), read.gaussians.len()), (format, scene.len()));
    assert!(read.gaussians.sh.degree <= written.degree && written.degree <= scene.sh.degree);
    let mut rows = written.order.clone();
    rows.sort_unstable();
    assert_eq!(rows, (0..scene.len()).collect::<Vec<_>>());
    File {
        bytes,
        written,
        scene: read,
    }
}

/// Gaussians in another order: row `i` is that at `order[i]`, and with other bands, 0 where there were none.
fn reordered(scene: &Gaussians, order: &[usize], degree: usize) -> Gaussians {
    let mut sh = Sh {
        degree,
        coefficients: Vec::new(),
    };
    let (stored, wanted) = (scene.sh.per_gaussian(), sh.per_gaussian());
    for row in order {
        let own = &scene.sh.coefficients[row * stored..(row + 1) * stored];
        sh.coefficients
            .extend(own.iter().copied().chain(std::iter::repeat(0.0)).take(wanted));
    }
    Gaussians {
        positions: order.iter().map(|row| scene.positions[*row]).collect(),
        rotations: order.iter().map(|row| scene.rotations[*row]).collect(),
        log_scales: order.iter().map(|row| scene.log_scales[*row]).collect(),
        opacity_logits: order.iter().map(|row| scene.opacity_logits[*row]).collect(),
        sh,
    }
}

/// Converts, reads back, and holds every number against what the format has steps for.
fn checked(scene: &Gaussians, format: Format) -> File {
    let file = converted(scene, format);
    let given = reordered(scene, &file.written.order, file.written.degree);
    let all: Vec<usize> = (0..scene.len()).collect();
    let read = reordered(&file.scene.gaussians, &all, file.written.degree);
    bounds::check(&given, &read, format, &file.bytes);
    file
}
