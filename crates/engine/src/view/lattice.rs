//! Directions that are spread evenly, and orders of them of which the first ones are, too.
use std::f32::consts::PI;

use super::vector::{dot, unit};

/// `n` evenly spread directions: a Fibonacci lattice in world axes.
pub(super) fn lattice(n: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..n).map(move |i| {
        let z = 1.0 - (2.0 * i as f32 + 1.0) / n as f32;
        let level = (1.0 - z * z).max(0.0).sqrt();
        // The golden angle.
        let (sine, cosine) = (i as f32 * PI * (3.0 - 5f32.sqrt())).sin_cos();
        unit([level * cosine, level * sine, z]).unwrap_or([0.0, 0.0, 1.0])
    })
}

/// Reorders points of a [`lattice`] so that any first ones lie as high as all do: by the fractions of multiples of the root of
/// two, from `shift` on. The [farthest](farthest_first) of a narrow zone lie mostly at its edges.
pub(super) fn evenly(points: Vec<[f32; 3]>, shift: f64) -> Vec<[f32; 3]> {
    let turn = |i: usize| (i as f64 * std::f64::consts::SQRT_2 + shift).fract();
    let mut turns: Vec<(f64, [f32; 3])> = points.into_iter().enumerate().map(|(i, p)| (turn(i), p)).collect();
    turns.sort_by(|a, b| a.0.total_cmp(&b.0));
    turns.into_iter().map(|(_, point)| point).collect()
}

/// Reorders points so that each is the farthest from all before it; ties go to the earlier one.
pub(super) fn farthest_first(mut points: Vec<[f32; 3]>, first: usize) -> Vec<[f32; 3]> {
    if !points.is_empty() {
        points.swap(0, first);
    }
    for done in 1..points.len() {
        let nearest = |p: [f32; 3]| points[..done].iter().map(|q| dot(p, *q)).fold(-1.0, f32::max);
        let closeness: Vec<f32> = points[done..].iter().map(|p| nearest(*p)).collect();
        let best = (0..closeness.len()).min_by(|a, b| closeness[*a].total_cmp(&closeness[*b]));
        points.swap(done, done + best.unwrap_or(0));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_ones_in_even_order_are_as_high_as_all() {
        let zone: Vec<[f32; 3]> = lattice(128).filter(|p| (0.2..0.77).contains(&p[2])).collect();
        let mean = |points: &[[f32; 3]]| points.iter().map(|p| p[2]).sum::<f32>() / points.len() as f32;
        let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
        for shift in 0..20 {
            let ordered = evenly(zone.clone(), f64::from(shift) / 20.0);
            assert_eq!(ordered.len(), zone.len());
            for count in [10, 20] {
                let off = mean(&ordered[..count]) - mean(&zone);
                (least, most) = (least.min(off), most.max(off));
            }
            // The first five look from all around: no direction of the zone is far from them.
            let far = |p: &[f32; 3]| ordered[..5].iter().map(|q| dot(*p, *q)).fold(-1.0, f32::max);
            assert!(zone.iter().map(far).fold(1.0, f32::min) > 75f32.to_radians().cos());
        }
        assert!(-0.06 < least && most < 0.06, "{least} {most}");
    }
}
