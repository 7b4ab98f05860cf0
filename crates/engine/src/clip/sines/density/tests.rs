//! Weights of rare colours against their definition, and their gradient.
use super::*;

/// Three pixels of one colour and one of another, both at corners of the grid.
const FOUR: [f32; 12] = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, -1.0, 1.0, 2.0, 2.0, 2.0, 2.0];

/// As the formula reads, in f64.
fn expected(picture: &[f32], equalization: f64) -> Vec<f64> {
    let pixels = picture.len() / 3;
    let corners = |pixel: usize| {
        let places: Vec<(usize, f64)> = (0..3)
            .map(|channel| {
                let at = f64::from(picture[channel * pixels + pixel] - LEAST).clamp(0.0, 5.0);
                let corner = (at as usize).min(CORNERS - 2);
                (corner, at - corner as f64)
            })
            .collect();
        (0..8).map(move |i| {
            let far = [i >> 2, i >> 1 & 1, i & 1];
            let share = |k: usize| if far[k] == 1 { places[k].1 } else { 1.0 - places[k].1 };
            let corner = (0..3).fold(0, |at, k| at * CORNERS + places[k].0 + far[k]);
            (corner, share(0) * share(1) * share(2))
        })
    };
    let mut grid = [0.0; GRID];
    (0..pixels)
        .flat_map(corners)
        .for_each(|(corner, share)| grid[corner] += share);
    let density = |pixel| corners(pixel).map(|(corner, share)| share * grid[corner]).sum::<f64>();
    let weights: Vec<f64> = (0..pixels).map(|p| density(p).max(0.125).powf(-equalization)).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

#[test]
fn weights_are_those_of_the_formula_and_the_same_on_every_instruction_set() {
    let channels = [(0.013, 1.9, 0.2), (0.0071, 1.2, 0.4), (0.031, 2.4, -0.3)];
    let value = |(rate, size, shift): (f32, f32, f32)| move |i: usize| shift + size * (i as f32 * rate).sin();
    let picture: Vec<f32> = channels.into_iter().flat_map(|c| (0..1111).map(value(c))).collect();
    for equalization in [0.2, 1.0] {
        let wanted = expected(&picture, f64::from(equalization));
        let sets: Vec<Vec<f32>> = Instructions::present()
            .map(|set| weights(set, &picture, 1, equalization))
            .collect();
        for (found, wanted) in sets[0].iter().zip(&wanted) {
            assert!((f64::from(*found) / wanted - 1.0).abs() < 1e-6, "{found} {wanted}");
        }
        assert!(sets.iter().all(|set| *set == sets[0]));
    }
}

#[test]
fn rare_colours_weigh_more() {
    let close = |found: Vec<f32>, expected: [f32; 4]| {
        let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(close, "{found:?} {expected:?}");
    };
    close(weights(Instructions::widest(), &FOUR, 1, 0.0), [0.25; 4]);
    // Each of the two colours half of all.
    close(
        weights(Instructions::widest(), &FOUR, 1, 1.0),
        [1.0 / 6.0, 1.0 / 6.0, 0.5, 1.0 / 6.0],
    );
    let (common, sum) = (3.0_f32.powf(-0.5), 3.0_f32.sqrt() + 1.0);
    close(
        weights(Instructions::widest(), &FOUR, 1, 0.5),
        [common, common, 1.0, common].map(|w| w / sum),
    );
}

#[test]
fn a_change_much_smaller_than_a_cell_hardly_changes_weights() {
    let picture = |change: f32| -> Vec<f32> {
        (0..300)
            .map(|i| (i as f32 * 0.37).sin() + change * (i as f32 * 1.7).cos())
            .collect()
    };
    let (before, after) = (
        weights(Instructions::widest(), &picture(0.0), 1, 0.2),
        weights(Instructions::widest(), &picture(0.05), 1, 0.2),
    );
    for (a, b) in before.iter().zip(&after) {
        assert!((a / b - 1.0).abs() < 0.03, "{a} {b}");
    }
}

#[test]
fn whatever_colours_come_weights_are_finite_and_add_up_to_one() {
    let odd = [
        f32::NAN,
        f32::INFINITY,
        -1e30,
        0.3,
        5.0,
        -7.0,
        0.0,
        2.15,
        -2.0,
        1e-30,
        0.1,
        -0.1,
    ];
    let found = weights(Instructions::widest(), &odd, 1, 1.0);
    assert!(found.iter().all(|w| w.is_finite() && *w > 0.0), "{found:?}");
    assert!((found.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    assert!(weights(Instructions::widest(), &[], 0, 1.0).is_empty());
}
