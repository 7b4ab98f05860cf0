//! How far numbers may be from those that were given, by what the formats say of their steps.
use super::*;
use crate::range::C0;
use std::collections::HashMap;
use std::io::{Cursor, Read};

/// Single precision of a number of this size, some of it for intermediate results.
fn rounding(value: f64) -> f64 {
    value.abs() * 4e-7 + 1e-37
}

/// Half of `steps` even steps from the least to the largest of some numbers.
struct Grid {
    least: f64,
    largest: f64,
    half: f64,
}

impl Grid {
    fn of(values: impl Iterator<Item = f64>, steps: f64) -> Grid {
        let (least, largest) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        Grid::new(least, largest, steps)
    }

    fn new(least: f64, largest: f64, steps: f64) -> Grid {
        Grid {
            least,
            largest,
            half: (largest - least) / steps / 2.0,
        }
    }

    fn check(&self, given: f64, read: f64, what: &str) {
        let given = given.clamp(self.least, self.largest);
        let limit = self.half * 1.0001 + rounding(self.least.abs().max(self.largest.abs()));
        assert!(
            (given - read).abs() <= limit,
            "{what}: {given} came back as {read}, limit {limit}"
        );
    }
}

/// Both scenes have the rows and the bands of the file.
pub(super) fn check(given: &Gaussians, read: &Gaussians, format: Format, bytes: &[u8]) {
    match format {
        Format::Ply => {
            assert_eq!(given, read);
            return;
        }
        Format::CompressedPly => packed(given, read),
        Format::Spz => spz(given, read),
        Format::Splat | Format::Ksplat => splat(given, read),
        Format::Sog => sog(given, read, bytes),
        Format::Gltf | Format::Glb => gltf(given, read),
    }
    opacities(given, read);
    // Half a step of a component other than the largest.
    rotations(
        given,
        read,
        match format {
            Format::CompressedPly => 0.5f64.sqrt() / 1023.0,
            Format::Spz => 0.5f64.sqrt() / 511.0 / 2.0,
            Format::Sog => 0.5f64.sqrt() / 127.5 / 2.0,
            Format::Ksplat | Format::Gltf | Format::Glb => 0.0,
            // Bytes have no 1.
            _ => 1.0 / 128.0,
        },
    );
}

fn opacities(given: &Gaussians, read: &Gaussians) {
    let grid = Grid::new(0.0, 1.0, 255.0);
    for (given, read) in given.opacity_logits.iter().zip(&read.opacity_logits) {
        let sigmoid = |logit: f32| 1.0 / (1.0 + (-f64::from(logit)).exp());
        grid.check(sigmoid(*given), sigmoid(*read), "an opacity");
    }
}

/// Three components are within `half`; the one that follows from them is half of the length at least, where it moves by
/// no more than their sum times the root of 3.
fn rotations(given: &Gaussians, read: &Gaussians, half: f64) {
    for (given, read) in given.rotations.iter().zip(&read.rotations) {
        let length = given.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        let unit = match length {
            0.0 => [1.0, 0.0, 0.0, 0.0],
            _ => given.map(|v| f64::from(v) / length),
        };
        let apart = |sign: f64| {
            let mut all: Vec<f64> = (0..4).map(|i| (sign * unit[i] - f64::from(read[i])).abs()).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        let [a, b] = [apart(1.0), apart(-1.0)];
        let nearer = if a[3] < b[3] { a } else { b };
        assert!(nearer[2] <= half * 1.001 + 1e-6, "{given:?} came back as {read:?}");
        assert!(
            nearer[3] <= 3.0 * 3f64.sqrt() * half + 1e-6,
            "{given:?} came back as {read:?}"
        );
    }
}

fn packed(given: &Gaussians, read: &Gaussians) {
    let each = given.sh.per_gaussian();
    for start in (0..given.len()).step_by(256) {
        let rows = start..given.len().min(start + 256);
        let check = |number: &dyn Fn(&Gaussians, usize) -> f64, steps: f64, what: &str| {
            let grid = Grid::of(rows.clone().map(|row| number(given, row)), steps);
            rows.clone()
                .for_each(|row| grid.check(number(given, row), number(read, row), what));
        };
        for (axis, steps) in [2047.0, 1023.0, 2047.0].into_iter().enumerate() {
            check(&|scene, row| f64::from(scene.positions[row][axis]), steps, "a position");
            let scale = |scene: &Gaussians, row: usize| f64::from(scene.log_scales[row][axis]).clamp(-20.0, 20.0);
            check(&scale, steps, "a log scale");
            let colour = |scene: &Gaussians, row: usize| 0.5 + C0 * f64::from(scene.sh.coefficients[row * each + axis]);
            check(&colour, 255.0, "a colour");
        }
    }
    let inner = Grid::new(-4.0, 4.0, 256.0);
    // A band of which every harmonic is next to 0 is dropped.
    let dropped = |place: usize| (0..read.len()).all(|row| read.sh.coefficients[row * each + place] == 0.0);
    for place in 3..each {
        let dropped = dropped(place);
        for row in 0..given.len() {
            let [given, read] = [given, read].map(|scene| f64::from(scene.sh.coefficients[row * each + place]));
            match dropped {
                true => assert!(given.abs() <= 1.0 / 32.0, "{given} was dropped"),
                false => inner.check(given, read, "a harmonic"),
            }
        }
    }
}

fn spz(given: &Gaussians, read: &Gaussians) {
    let largest = given
        .positions
        .as_flattened()
        .iter()
        .fold(0.0f32, |most, v| most.max(v.abs()));
    // Twelve digits after the point, and eleven before it with the sign.
    let mut step = 2f64.powi(-12);
    while f64::from(largest) / step >= 8_388_607.5 {
        step *= 2.0;
    }
    for (given, read) in given.positions.as_flattened().iter().zip(read.positions.as_flattened()) {
        let apart = (f64::from(*given) - f64::from(*read)).abs();
        assert!(
            apart <= step / 2.0 + rounding(f64::from(*given)),
            "{given} came back as {read}"
        );
    }
    let scale = Grid::new(-10.0, 255.0 / 16.0 - 10.0, 255.0);
    for (given, read) in given
        .log_scales
        .as_flattened()
        .iter()
        .zip(read.log_scales.as_flattened())
    {
        scale.check((*given).into(), (*read).into(), "a log scale");
    }
    let constant = Grid::new(-127.5 / 38.25, 127.5 / 38.25, 255.0);
    let each = given.sh.per_gaussian();
    for (i, (given, read)) in given.sh.coefficients.iter().zip(&read.sh.coefficients).enumerate() {
        let (place, given, read) = (i % each, f64::from(*given), f64::from(*read));
        if place < 3 {
            constant.check(given, read, "a constant colour");
            continue;
        }
        // To a whole number of 1/128, then by half a bucket of 8 or 16.
        let limit = if place < 12 { 4.5 } else { 8.5 } / 128.0;
        let apart = (given.clamp(-1.0, 127.0 / 128.0) - read).abs();
        assert!(apart <= limit + 1e-6, "harmonic {place}: {given} came back as {read}");
    }
}

fn gltf(given: &Gaussians, read: &Gaussians) {
    assert_eq!(given.positions, read.positions);
    assert_eq!(given.sh, read.sh);
    for (given, read) in given
        .log_scales
        .as_flattened()
        .iter()
        .zip(read.log_scales.as_flattened())
    {
        let apart = (f64::from(*given) - f64::from(*read)).abs();
        // The largest and the least of single precision.
        let kept = (-80.0..88.7).contains(given);
        assert!(
            given == read || apart <= 1e-6 * f64::from(given.abs()).max(1.0) || !kept,
            "{given} came back as {read}"
        );
    }
    for (given, read) in given.opacity_logits.iter().zip(&read.opacity_logits) {
        let sigmoid = |logit: f32| 1.0 / (1.0 + (-f64::from(logit)).exp());
        assert!(
            (sigmoid(*given) - sigmoid(*read)).abs() <= 6e-8,
            "{given} came back as {read}"
        );
    }
}

fn splat(given: &Gaussians, read: &Gaussians) {
    assert_eq!(given.positions, read.positions);
    for (given, read) in given
        .log_scales
        .as_flattened()
        .iter()
        .zip(read.log_scales.as_flattened())
    {
        let apart = (f64::from(*given) - f64::from(*read)).abs();
        assert!(
            given == read || apart <= 1e-6 * f64::from(given.abs()).max(1.0),
            "{given} came back as {read}"
        );
    }
    let colour = Grid::new(-0.5 / C0, 0.5 / C0, 255.0);
    let each = given.sh.per_gaussian();
    for (i, (given, read)) in given.sh.coefficients.iter().zip(&read.sh.coefficients).enumerate() {
        match i % each {
            0..3 => colour.check((*given).into(), (*read).into(), "a colour"),
            place => assert_eq!(given, read, "harmonic {place}"),
        }
    }
}

fn sog(given: &Gaussians, read: &Gaussians, bytes: &[u8]) {
    let log = |v: f32| f64::from(v.abs()).ln_1p().copysign(f64::from(v));
    for axis in 0..3 {
        let grid = Grid::of(given.positions.iter().map(|p| log(p[axis])), 65535.0);
        for (given, read) in given.positions.iter().zip(&read.positions) {
            // As logarithms single precision is less by as much as they are flatter.
            grid.check(log(given[axis]), log(read[axis]), "a position");
        }
    }
    let meta = meta(bytes);
    let numbers = |property: &str| -> Vec<f64> {
        let list = meta[property]["codebook"].as_array().unwrap();
        assert_eq!(list.len(), 256);
        list.iter().map(|v| v.as_f64().unwrap()).collect()
    };
    let scales = numbers("scales");
    for (given, read) in given
        .log_scales
        .as_flattened()
        .iter()
        .zip(read.log_scales.as_flattened())
    {
        nearest((*given).into(), (*read).into(), &scales);
    }
    let (colours, each) = (numbers("sh0"), given.sh.per_gaussian());
    let rows = || {
        given
            .sh
            .coefficients
            .chunks(each)
            .zip(read.sh.coefficients.chunks(each))
    };
    for (given, read) in rows() {
        (0..3).for_each(|i| nearest(given[i].into(), read[i].into(), &colours));
    }
    if each == 3 || given.is_empty() {
        return;
    }
    // Those that share a row have the mean of theirs, on the numbers of the codebook.
    let mut shared: HashMap<Vec<u32>, (f64, Vec<f64>)> = HashMap::new();
    for (given, read) in rows() {
        let key = read[3..].iter().map(|v| v.to_bits()).collect();
        let (count, sums) = shared.entry(key).or_insert_with(|| (0.0, vec![0.0; each - 3]));
        *count += 1.0;
        sums.iter_mut()
            .zip(&given[3..])
            .for_each(|(sum, v)| *sum += f64::from(*v));
    }
    let harmonics = numbers("shN");
    assert!(shared.len() <= meta["shN"]["count"].as_u64().unwrap() as usize);
    for (row, (count, sums)) in &shared {
        for (read, sum) in row.iter().zip(sums) {
            nearest(sum / count, f32::from_bits(*read).into(), &harmonics);
        }
    }
}

/// No number is nearer than the one that was read; 20 below all others is minus infinity.
fn nearest(given: f64, read: f64, numbers: &[f64]) {
    if given == f64::NEG_INFINITY {
        assert_eq!(read, numbers[0]);
        return;
    }
    let least = numbers.iter().map(|v| (v - given).abs()).fold(f64::INFINITY, f64::min);
    assert!(
        (given - read).abs() <= least + rounding(given) + 1e-9,
        "{given} came back as {read}"
    );
}

fn meta(bytes: &[u8]) -> serde_json::Value {
    let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut text = String::new();
    zip.by_name("meta.json").unwrap().read_to_string(&mut text).unwrap();
    serde_json::from_str(&text).unwrap()
}
