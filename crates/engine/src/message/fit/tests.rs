//! Fits against their definition and on words that were made.
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

const WIDTH: usize = 12;

/// Rows around `offset` whose dimension i has spread `spread(i)`.
fn rows(n: usize, seed: u64, offset: f32, spread: impl Fn(usize) -> f32) -> Vec<f32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..n * WIDTH)
        .map(|i| offset + spread(i % WIDTH) * (rng.random::<f32>() - 0.5))
        .collect()
}

fn options(remove: usize, keep: Option<usize>) -> FitOptions {
    FitOptions {
        remove,
        keep,
        ranked: false,
    }
}

fn fitted(images: &[f32], texts: &[f32], options: FitOptions) -> Projection {
    fit(images, texts, WIDTH, options).unwrap()
}

fn features() -> (Vec<f32>, Vec<f32>) {
    // Pictures vary most in dimensions 0 and 1, texts least in 2.
    let images = rows(400, 1, 0.3, |i| if i < 2 { 5.0 } else { 0.2 + 0.02 * i as f32 });
    let texts = rows(300, 2, -0.4, |i| if i == 2 { 0.001 } else { 0.05 });
    (images, texts)
}

fn check_spread(projected: &[f32], rank: usize) -> Vec<f64> {
    let (mean, covariance) = covariance("projected", projected, rank).unwrap();
    assert!(mean.iter().all(|m| m.abs() < 1e-4), "{mean:?}");
    let trace: f64 = (0..rank).map(|i| covariance[i * rank + i]).sum();
    assert!((trace / rank as f64 - 1.0).abs() < 1e-3, "{trace}");
    covariance
}

#[test]
fn strong_natural_directions_vanish_and_spreads_agree() {
    let (images, texts) = features();
    let p = fitted(&images, &texts, options(2, None));
    p.check().unwrap();
    assert_eq!((p.width, p.rank), (WIDTH, 10));
    for matrix in [&p.matrix_image, &p.matrix_text] {
        let norm = |row: &[f32]| row.iter().map(|v| v * v).sum::<f32>().sqrt();
        assert!(norm(&matrix[..2 * p.rank]) < 0.05 * norm(&matrix[2 * p.rank..]));
    }
    check_spread(&p.project_text(&texts), p.rank);
    check_spread(&p.project_image(&images), p.rank);
}

#[test]
fn texts_vary_alike_in_all_directions() {
    let (images, texts) = features();
    let p = fitted(&images, &texts, options(2, Some(9)));
    let covariance = check_spread(&p.project_text(&texts), p.rank);
    for (i, row) in covariance.chunks_exact(p.rank).enumerate() {
        for (j, value) in row.iter().enumerate() {
            let expected = if i == j { 1.0 } else { 0.0 };
            assert!((value - expected).abs() < 1e-2, "{i} {j} {value}");
        }
    }
}

#[test]
fn noise_has_the_covariance_of_projected_pictures() {
    let (images, texts) = features();
    for keep in [None, Some(4)] {
        let p = fitted(&images, &texts, options(3, keep));
        let covariance = check_spread(&p.project_image(&images), p.rank);
        let f: Vec<f64> = p.noise.iter().map(|&v| f64::from(v)).collect();
        for (i, row) in f.chunks_exact(p.rank).enumerate() {
            assert!(row[i + 1..].iter().all(|&v| v == 0.0));
            for (j, other) in f.chunks_exact(p.rank).enumerate() {
                assert!((dot(row, other) - covariance[i * p.rank + j]).abs() < 1e-3);
            }
        }
    }
}

#[test]
fn keep_takes_the_directions_in_which_texts_vary() {
    let (images, texts) = features();
    let p = fitted(&images, &texts, options(2, Some(9)));
    let dimension_2 = &p.matrix_text[2 * p.rank..3 * p.rank];
    let other = &p.matrix_text[5 * p.rank..6 * p.rank];
    let norm = |row: &[f32]| row.iter().map(|v| v * v).sum::<f32>();
    assert!(norm(dimension_2) < 0.01 * norm(other));
}

#[test]
fn fewer_pictures_than_dimensions_are_enough() {
    let (_, texts) = features();
    let images = rows(6, 4, 0.0, |_| 1.0);
    let p = fitted(&images, &texts, options(2, None));
    p.check().unwrap();
}

#[test]
fn bad_input_is_refused() {
    let (images, texts) = features();
    let reason = |i: &[f32], t: &[f32], o| fit(i, t, WIDTH, o).unwrap_err().to_string();
    assert!(reason(&images, &texts, options(12, None)).contains("leave nothing of 12"));
    assert!(reason(&images, &texts, options(2, Some(11))).contains("1 to 10"));
    assert!(reason(&images[..WIDTH], &texts, options(0, None)).contains("two or more rows"));
    assert!(reason(&images[..4 * WIDTH], &texts, options(4, None)).contains("4 pictures"));
    assert!(reason(&images, &[0.5; 3 * WIDTH], options(0, None)).contains("do not vary"));
    let mut broken = texts.clone();
    broken[WIDTH + 1] = f32::INFINITY;
    assert!(reason(&images, &broken, options(0, None)).contains("row 1 holds inf"));
}
