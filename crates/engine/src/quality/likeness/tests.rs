//! SSIM and differences against their definitions, and their gradients.
use super::*;
use crate::quality::window::{RADIUS, weight};

fn picture(width: u32, height: u32, seed: u32) -> Picture {
    let value = |i: u32| ((i * 7 + seed * 13) % 29) as f32 / 26.0 - 0.05;
    Picture {
        width,
        height,
        pixels: (0..3 * width * height).map(value).collect(),
    }
}

fn clamped(picture: &Picture) -> Picture {
    let pixels = picture.pixels.iter().map(|v| v.clamp(0.0, 1.0)).collect();
    Picture { pixels, ..*picture }
}

/// The weighted terms by their definitions, window by window, in f64; and L1 and SSIM.
fn reference(x: &Picture, y: &Picture, weights: LikenessWeights) -> [f64; 3] {
    let (width, height) = (x.width as usize, x.height as usize);
    let value = |picture: &Picture, at: usize| f64::from(picture.pixels[at]).clamp(0.0, 1.0);
    let [mut l1, mut l2, mut ssim] = [0.0; 3];
    for at in 0..x.pixels.len() {
        let (channel, column, row) = (at % 3, at / 3 % width, at / 3 / width);
        let mut m = [0.0; 5];
        for v in row.saturating_sub(RADIUS)..height.min(row + RADIUS + 1) {
            for u in column.saturating_sub(RADIUS)..width.min(column + RADIUS + 1) {
                let share = weight(u.abs_diff(column)) * weight(v.abs_diff(row));
                let near = (v * width + u) * 3 + channel;
                let (a, b) = (value(x, near), value(y, near));
                let moments = [a, b, a * a, b * b, a * b];
                m.iter_mut().zip(moments).for_each(|(m, value)| *m += share * value);
            }
        }
        let [a, b, aa, bb, ab] = m;
        let (c1, c2) = (1e-4, 9e-4);
        let numerator = (2.0 * a * b + c1) * (2.0 * (ab - a * b) + c2);
        ssim += numerator / ((a * a + b * b + c1) * (aa - a * a + bb - b * b + c2));
        let difference = value(y, at) - value(x, at);
        (l1, l2) = (l1 + difference.abs(), l2 + difference * difference);
    }
    let [l1, l2, ssim] = [l1, l2, ssim].map(|sum| sum / x.pixels.len() as f64);
    let terms = [(weights.l1, l1), (weights.l2, l2), (weights.ssim, ssim)];
    [terms.iter().map(|(w, term)| f64::from(*w) * term).sum(), l1, ssim]
}

#[test]
fn values_and_gradient_are_those_of_the_definition() {
    let weights = LikenessWeights {
        l1: 0.3,
        l2: 5.0,
        ssim: -2.0,
    };
    let pairs = [
        (picture(19, 13, 1), picture(19, 13, 2)),
        (picture(19, 13, 3), picture(19, 13, 9)),
    ];
    let borrowed: Vec<(&Picture, &Picture)> = pairs.iter().map(|(a, b)| (a, b)).collect();
    let (found, gradients) = likeness_with_gradient(&borrowed, weights);
    for (((x, y), found), gradient) in pairs.iter().zip(&found).zip(&gradients) {
        let [_, l1, ssim] = reference(x, y, weights);
        assert!(
            (found.l1 - l1).abs() < 1e-6 && (found.ssim - ssim).abs() < 1e-5,
            "{found:?}"
        );
        assert!((mean_ssim(&clamped(x), &clamped(y)) - ssim).abs() < 1e-5);
        let mut beyond = 0;
        for at in (0..y.pixels.len()).step_by(17) {
            let shown = y.pixels[at];
            if !(0.0..=1.0).contains(&shown) {
                assert_eq!(gradient[at], 0.0);
                beyond += 1;
                continue;
            }
            if !(0.01..0.99).contains(&shown) || (shown - x.pixels[at]).abs() < 0.01 {
                continue; // no slope there, or two
            }
            let moved = |step: f32| {
                let mut moved = y.clone();
                moved.pixels[at] += step;
                reference(x, &moved, weights)[0]
            };
            // The mean is over both pairs.
            let slope = (moved(1e-3) - moved(-1e-3)) / 2e-3 / 2.0;
            let gap = (f64::from(gradient[at]) - slope).abs();
            assert!(gap < 1e-6 + 2e-3 * slope.abs(), "{at}: {} {slope}", gradient[at]);
        }
        assert!(beyond > 0);
    }
}

#[test]
fn parts_of_rows_and_threads_make_no_difference() {
    let (x, y) = (clamped(&picture(31, 150, 1)), clamped(&picture(31, 150, 5)));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| mean_ssim(&x, &y))
    };
    assert_eq!(with(1).to_bits(), with(3).to_bits());
    assert!(
        (with(1)
            - reference(
                &x,
                &y,
                LikenessWeights {
                    l1: 0.0,
                    l2: 0.0,
                    ssim: 0.0
                }
            )[2])
            .abs()
            < 1e-5
    );
}
