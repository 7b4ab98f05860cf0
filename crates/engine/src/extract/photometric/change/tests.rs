//! Changes of tones and their undoing.
use super::*;

fn picture(pixels: Vec<f32>) -> Picture {
    Picture {
        width: (pixels.len() / 3) as u32,
        height: 1,
        pixels,
    }
}

#[test]
fn each_factor_is_undone_as_it_was_done() {
    let before = picture((0..60).map(|i| 0.3 + 0.3 * (i as f32 * 0.37).sin().abs()).collect());
    for place in 0..ToneChange::BEND {
        for log in [-0.2, 0.2] {
            let change = |log: f32| {
                let mut change = ToneChange::default();
                change.coordinates[place] = log;
                change
            };
            let done = change(-log).undone(&before, &before).unwrap();
            assert_ne!(done, before);
            let after = change(log).undone(&done, &done).unwrap();
            for (a, b) in after.pixels.iter().zip(&before.pixels) {
                assert!((a - b).abs() < 1e-5, "{place} {log}: {a} {b}");
            }
        }
    }
}

#[test]
fn a_tone_of_all_channels_is_a_change() {
    let before = picture((0..60).map(|i| 0.3 + 0.3 * (i as f32 * 0.37).sin().abs()).collect());
    let done = [
        (Tone::Brightness(1.2), before.pixels.iter().map(|v| v * 1.2).collect()),
        (
            Tone::Gamma(0.8),
            before.pixels.iter().map(|v| v.powf(0.8)).collect::<Vec<f32>>(),
        ),
    ];
    for (tone, pixels) in done {
        let after = ToneChange::of_tone(tone).undone_at_any_rate(&picture(pixels));
        for (a, b) in after.pixels.iter().zip(&before.pixels) {
            assert!((a - b).abs() < 1e-5, "{tone:?}: {a} {b}");
        }
    }
    // Values that were never there are cut, where nobody asks whether they can have been.
    let dark = ToneChange::of_tone(Tone::Brightness(0.5));
    assert_eq!(dark.undone_at_any_rate(&picture(vec![0.9; 3])).pixels, [1.0; 3]);
}

/// Places that all have this amount, and what that does to a value.
type Done<'a> = (&'a [usize], f32, &'a dyn Fn(&f32) -> f32);

#[test]
fn fades_and_curves_are_undone() {
    let before = picture((0..90).map(|i| 0.2 + 0.008 * i as f32).collect());
    let sine = |v: &f32| (std::f32::consts::TAU * v).sin() / std::f32::consts::TAU;
    let faded = &ToneChange::FADES[..];
    let bent = &[ToneChange::BEND][..];
    let all: [Done<'_>; 4] = [
        (faded, 0.2, &|v| 0.2 + 0.8 * v),
        (faded, -0.1, &|v| -0.1 + 1.1 * v),
        (bent, 0.6, &|v| v - 0.6 * sine(v)),
        (bent, -0.4, &|v| v + 0.4 * sine(v)),
    ];
    for (places, amount, done) in all {
        let mut change = ToneChange::default();
        places.iter().for_each(|place| change.coordinates[*place] = amount);
        let done = picture(before.pixels.iter().map(done).collect());
        let after = change.undone(&done, &done).unwrap();
        for (a, b) in after.pixels.iter().zip(&before.pixels) {
            assert!((a - b).abs() < 0.002, "{places:?} {amount}: {a} {b}");
        }
    }
}

#[test]
fn a_ground_tells_the_colour_that_was_laid_over_it() {
    let before = picture((0..90).map(|i| 0.01 * i as f32).collect());
    let over = [0.8, 0.85, 1.0];
    let laid = |(i, v): (usize, &f32)| 0.85 * v + 0.15 * over[i % 3];
    let done = picture(before.pixels.iter().enumerate().map(laid).collect());
    let ground = over.map(|v| 0.85 + 0.15 * v);
    let after = ToneChange::overlay(ground, 0.15).unwrap().undone(&done, &done).unwrap();
    for (a, b) in after.pixels.iter().zip(&before.pixels) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
    assert_eq!(ToneChange::overlay([0.6, 1.0, 1.0], 0.2), None);
}

#[test]
fn contrast_is_undone_about_the_mean_from_before_a_ground_was_cut() {
    let scene = (0..30).map(|i| 0.3 + 0.01 * i as f32);
    let before = picture(scene.chain(std::iter::repeat_n(1.0, 60)).collect());
    let mean = before.pixels.iter().sum::<f32>() / before.pixels.len() as f32;
    let more = |v: &f32| (mean + 1.2 * (v - mean)).clamp(0.0, 1.0);
    let done = picture(before.pixels.iter().map(more).collect());
    let mut change = ToneChange::default();
    change.coordinates[ToneChange::CONTRAST] = 1.2_f32.ln();
    let after = change.undone(&done, &done).unwrap();
    for (a, b) in after.pixels.iter().zip(&before.pixels[..30]) {
        assert!((a - b).abs() < 0.003, "{a} {b}");
    }
}

#[test]
fn nothing_is_said_by_colours_that_were_cut() {
    // Twice as bright: red was cut, so that nobody knows the first colour any more.
    let now = picture([[1.0, 0.4, 0.2], [0.6, 0.4, 0.2], [0.0, 0.4, 0.2]].concat());
    let before = ToneChange::of_gains([2.0_f32.ln(); 3]).undone_at_any_rate(&now);
    let expected = [1.0, 1.0, 1.0, 0.3, 0.2, 0.1, 0.0, 0.2, 0.1];
    for (a, b) in before.pixels.iter().zip(expected) {
        assert!((a - b).abs() < 1e-6, "{:?}", before.pixels);
    }
    // Levels stretched to black, and a gamma, which leaves black where it is.
    let stretched = ToneChange::of_shape(0.0, -0.1).undone_at_any_rate(&now);
    assert_eq!(stretched.pixels[6..], [1.0; 3]);
    assert!(stretched.pixels[3..6].iter().all(|v| *v < 0.9));
    let gamma = ToneChange::of_tone(Tone::Gamma(1.2)).undone_at_any_rate(&now);
    assert!(gamma.pixels[0] > 0.999 && gamma.pixels[6] < 1e-6);
    assert!(gamma.pixels[7] < 0.9);
}

#[test]
fn what_cannot_have_been_done_is_told() {
    let dim = picture(vec![0.9; 30]);
    let change = ToneChange::of_gains([-0.4; 3]);
    assert_eq!(change.undone(&dim, &dim), None);
    // White that was cut says nothing.
    let white = picture(vec![1.0; 30]);
    assert_eq!(change.undone(&white, &white), Some(white.clone()));
    let fitted = change.with_white([0.9, 0.8, 1.0], &dim);
    let gains = fitted.coordinates.map(f32::exp);
    assert!((gains[0] - 0.9).abs() < 1e-6 && (gains[1] - 0.8).abs() < 1e-6 && gains[2] == 1.0);
}

#[test]
fn changes_are_told_in_words() {
    let logs = [0.8_f32, 0.8, 0.88, 1.0, 1.2, 1.0].map(f32::ln);
    let mut change = ToneChange::default();
    change.coordinates[..6].copy_from_slice(&logs);
    ToneChange::FADES
        .iter()
        .for_each(|place| change.coordinates[*place] = 0.1);
    let told = "brightness x 0.81, red x 0.99, green x 0.99, blue x 1.09, saturation x 1.20, black at 0.10 undone";
    assert_eq!(change.to_string(), told);
    assert_eq!(ToneChange::default().to_string(), "tones as they are");
}
