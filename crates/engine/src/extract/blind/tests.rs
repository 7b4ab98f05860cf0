//! The blind choice on pictures whose marks and tones are known, with an extractor of a few lines.
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use burn::tensor::{Tensor, TensorData};
use guardsplat_codeword::{Hypothesis, Message, NEXT_ESTIMATES, Reading, chance};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::clip::config::Tones;
use crate::device::{DeviceChoice, open};
use crate::extract::{Extractor, PictureLogits, estimates, hypotheses};

/// Bits, each read from a patch of its own.
const BITS: usize = 32;
/// Patches a row, their width and height.
const PATCHES: (usize, usize, usize) = (8, 4, 8);
const SIDE: usize = 32;
/// Radians that a change of a colour by 1 turns a logit by.
const GAIN: f32 = 25.0;

/// What a bit is read by.
#[derive(Clone, Copy)]
struct Patch {
    colour: [f32; 3],
    /// Radians a unit of each channel.
    wave: [f32; 3],
}

/// Reads a bit as 1 where a patch has a colour that belongs to it, as 0 half a turn from it: exact colours.
struct Patches {
    patches: Vec<Patch>,
    read: Arc<AtomicUsize>,
}

impl Extractor for Patches {
    fn bits(&self) -> usize {
        BITS
    }

    fn side(&self) -> usize {
        SIDE
    }

    fn parameters(&self) -> usize {
        0
    }

    fn reads_exact_colours(&self) -> bool {
        true
    }

    fn tones(&self) -> Tones {
        Tones::Estimated
    }

    fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        let device = pictures.device();
        let pictures = crate::resize::resize(pictures, SIDE, SIDE);
        let count = pictures.dims()[0];
        self.read.fetch_add(count, Ordering::Relaxed);
        let values: Vec<f32> = pictures.try_into_vec_as::<f32>().unwrap();
        let logit = |i: usize| {
            let ((x, y), Patch { colour, wave }) = (centre(i % BITS), self.patches[i % BITS]);
            let value = |c: usize| values[((i / BITS * 3 + c) * SIDE + y) * SIDE + x];
            5.0 * (0..3).map(|c| wave[c] * (value(c) - colour[c])).sum::<f32>().cos()
        };
        let logits: Vec<f32> = (0..count * BITS).map(logit).collect();
        Ok(Tensor::from_data(TensorData::new(logits, [count, BITS]), &device))
    }
}

fn centre(bit: usize) -> (usize, usize) {
    let (columns, width, height) = PATCHES;
    (bit % columns * width + width / 2, bit / columns * height + height / 2)
}

fn engine() -> (Engine, Vec<Patch>, Arc<AtomicUsize>) {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut patch = || {
        let direction: [f32; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let length = direction.iter().map(|v| v * v).sum::<f32>().sqrt();
        Patch {
            colour: std::array::from_fn(|_| rng.random_range(0.25..0.6)),
            wave: direction.map(|v| GAIN * v / length),
        }
    };
    let patches: Vec<Patch> = (0..BITS).map(|_| patch()).collect();
    let read = Arc::new(AtomicUsize::new(0));
    let extractor = Patches {
        patches: patches.clone(),
        read: read.clone(),
    };
    let compute = open(DeviceChoice::Cpu).unwrap();
    (
        Engine::with_extractor(compute, Box::new(extractor), None),
        patches,
        read,
    )
}

/// A picture with a patch of one colour a bit.
fn picture(colours: &[[f32; 3]]) -> Picture {
    let (columns, width, height) = PATCHES;
    let pixels = (0..SIDE * SIDE).flat_map(|i| colours[i / SIDE / height * columns + i % SIDE / width]);
    Picture {
        width: SIDE as u32,
        height: SIDE as u32,
        pixels: pixels.collect(),
    }
}

/// A picture that says a message.
fn marked(patches: &[Patch], message: &Message) -> Picture {
    let half_a_turn = std::f32::consts::PI / (GAIN * GAIN);
    let said = message.bits().zip(patches).map(|(bit, Patch { colour, wave })| {
        let turned = if bit { 0.0 } else { half_a_turn };
        std::array::from_fn(|c| colour[c] + turned * wave[c])
    });
    picture(&said.collect::<Vec<_>>())
}

/// The picture after a change: logarithms of gains, gamma, saturation and contrast.
fn done(logs: [f32; 6], picture: &Picture) -> Picture {
    // What is undone by the inverse is done; one coordinate after the other, in the order of doing.
    (0..6).fold(picture.clone(), |picture, place| {
        let mut inverse = ToneChange::default();
        inverse.coordinates[place] = -logs[place];
        inverse.undone(&picture, &picture).unwrap()
    })
}

fn right(logits: &[f32], message: &Message) -> u32 {
    Reading::from_logits(logits).unwrap().matches(message).unwrap()
}

fn random_message(rng: &mut ChaCha8Rng) -> Message {
    Message::from_bits(&(0..BITS).map(|_| rng.random()).collect::<Vec<bool>>()).unwrap()
}

#[test]
fn changed_tones_are_found_and_the_work_is_bounded() {
    let (engine, patches, read) = engine();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut seen_clear = [false; 2];
    for logs in [
        [0.0; 6],
        [-0.5, -0.5, -0.5, 0.0, 0.0, 0.0],
        [0.3, 0.3, 0.3, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, -0.25, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.3, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, -0.3],
        [0.06, 0.0, -0.05, 0.0, 0.0, 0.0],
        [0.13, 0.1, 0.07, 0.0, 0.0, 0.0],
    ] {
        let message = random_message(&mut rng);
        let changed = done(logs, &marked(&patches, &message));
        read.store(0, Ordering::Relaxed);
        let found = PictureLogits::read(&engine, &changed, None, &[]).unwrap();
        let passes = read.load(Ordering::Relaxed);
        // Guesses are read only where the estimate is not clear.
        let clear = hypotheses(&engine, std::slice::from_ref(&found)).unwrap().len() == 2;
        seen_clear[usize::from(clear)] = true;
        assert!(passes <= if clear { 400 } else { 560 }, "{passes}");
        let estimate = estimates(std::slice::from_ref(&found))[0].unwrap();
        assert_eq!(right(estimate.logits(), &message), BITS as u32, "{logs:?}: {estimate}");
        // A little of the others leaves these patches readable.
        if logs[0].abs().max(logs[3].abs()) > 0.2 {
            assert!(right(found.as_given(), &message) < BITS as u32, "{logs:?}");
        }
    }
    assert_eq!(seen_clear, [true; 2]);
}

#[test]
fn fades_curves_and_wider_tints_are_found() {
    let (engine, patches, _) = engine();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let sine = |v: f32| (std::f32::consts::TAU * v).sin() / std::f32::consts::TAU;
    let each = |picture: &Picture, change: &dyn Fn(usize, f32) -> f32| Picture {
        pixels: picture
            .pixels
            .iter()
            .enumerate()
            .map(|(i, v)| change(i % 3, *v))
            .collect(),
        ..*picture
    };
    let changes: [&dyn Fn(usize, f32) -> f32; 6] = [
        &|_, v| 0.15 + 0.85 * v,
        &|_, v| (v - 0.08) / 0.92,
        &|c, v| [0.12, 0.1, 0.08][c] + (1.0 - [0.12, 0.1, 0.08][c]) * v,
        &|_, v| v - 0.5 * sine(v),
        &|_, v| v + 0.3 * sine(v),
        &|c, v| [1.12, 1.0, 0.9][c] * v,
    ];
    for (place, change) in changes.into_iter().enumerate() {
        let message = random_message(&mut rng);
        let changed = each(&marked(&patches, &message), change);
        let found = PictureLogits::read(&engine, &changed, None, &[]).unwrap();
        let estimate = estimates(std::slice::from_ref(&found))[0].unwrap();
        assert!(
            right(estimate.logits(), &message) >= BITS as u32 - 1,
            "{place}: {estimate}"
        );
    }
}

#[test]
fn pictures_of_one_message_with_tones_of_their_own_are_read_together() {
    let (engine, patches, _) = engine();
    let message = random_message(&mut ChaCha8Rng::seed_from_u64(2));
    let clean = marked(&patches, &message);
    let mut framed = Picture {
        width: 64,
        height: 64,
        pixels: vec![0.9; 3 * 64 * 64],
    };
    for y in 0..SIDE {
        framed.pixels[3 * ((y + 20) * 64 + 12)..][..3 * SIDE]
            .copy_from_slice(&clean.pixels[3 * y * SIDE..][..3 * SIDE]);
    }
    let pictures = [
        done([-0.3, -0.3, -0.3, 0.0, 0.0, 0.0], &clean),
        done([0.0, 0.0, 0.0, 0.2, 0.0, 0.0], &clean),
        framed,
    ];
    let read: Vec<_> = pictures
        .iter()
        .map(|p| PictureLogits::read(&engine, p, None, &[]).unwrap())
        .collect();
    let readings = hypotheses(&engine, &read).unwrap();
    assert_eq!(readings[1].0, Hypothesis::estimated());
    assert_eq!(right(&readings[1].1.summed, &message), BITS as u32);
    assert!(readings[1].1.views.iter().all(|view| right(view, &message) >= 31));
    let words: Vec<String> = estimates(&read)
        .into_iter()
        .map(|estimate| estimate.unwrap().to_string())
        .collect();
    assert!(
        words[0].contains("brightness x 0.7") && words[2].contains("without borders"),
        "{words:?}"
    );
}

#[test]
fn the_next_best_estimates_of_a_picture_alone_are_hypotheses_of_their_own() {
    let (engine, _, _) = engine();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let unmarked = || -> Picture {
        let colours: Vec<[f32; 3]> = (0..BITS)
            .map(|_| std::array::from_fn(|_| rng.random_range(0.0..1.0)))
            .collect();
        picture(&colours)
    };
    let read: Vec<_> = std::iter::repeat_with(unmarked)
        .map(|picture| PictureLogits::read(&engine, &picture, None, &[]).unwrap())
        .filter(|read| !read.blind().is_clear())
        .take(2)
        .collect();
    let next = NEXT_ESTIMATES.map(Hypothesis::estimated_next);
    let alone = hypotheses(&engine, &read[..1]).unwrap();
    let candidates = read[0].blind().candidates();
    for ((hypothesis, logits), (place, candidate)) in alone[1..].iter().zip((1..=4).zip(candidates)) {
        let expected = match place {
            1 => Hypothesis::estimated(),
            place => Hypothesis::estimated_next(place),
        };
        assert_eq!((*hypothesis, &logits.summed[..]), (expected, candidate.logits()));
    }
    assert_eq!(
        alone
            .iter()
            .filter(|(way, _)| next.clone().any(|next| next == *way))
            .count(),
        3
    );
    // Those of several agree.
    let together = hypotheses(&engine, &read).unwrap();
    assert!(together.iter().all(|(way, _)| next.clone().all(|next| next != *way)));
}

#[test]
fn words_that_nobody_marked_match_an_estimate_as_often_as_chance_says() {
    let (engine, _, _) = engine();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (pictures, words) = (24, 2000);
    let mut matched = [0_u32; BITS + 1];
    for _ in 0..pictures {
        let colours: Vec<[f32; 3]> = (0..BITS)
            .map(|_| std::array::from_fn(|_| rng.random_range(0.0..1.0)))
            .collect();
        let read = [PictureLogits::read(&engine, &picture(&colours), None, &[]).unwrap()];
        let (_, estimated) = hypotheses(&engine, &read).unwrap().swap_remove(1);
        for _ in 0..words {
            matched[right(&estimated.summed, &random_message(&mut rng)) as usize] += 1;
        }
    }
    let all = f64::from(pictures * words);
    for least in [20, 22, 24, 26] {
        let expected = chance::tail(BITS as u32, least).unwrap();
        let found = f64::from(matched[least as usize..].iter().sum::<u32>()) / all;
        // Four deviations of so many trials.
        assert!(
            (found - expected).abs() < 4.0 * (expected / all).sqrt(),
            "{least}: {found} {expected}"
        );
    }
}

#[test]
fn pictures_that_show_nothing_are_read_too() {
    let (engine, _, _) = engine();
    for (width, height) in [(1, 1), (3, 200), (64, 64)] {
        for level in [0.0, 0.5, 1.0] {
            let plain = Picture {
                width,
                height,
                pixels: vec![level; (3 * width * height) as usize],
            };
            let read = [PictureLogits::read(&engine, &plain, None, &[]).unwrap()];
            let readings = hypotheses(&engine, &read).unwrap();
            assert!(
                readings
                    .iter()
                    .all(|(_, logits)| logits.summed.iter().all(|v| v.is_finite()))
            );
        }
    }
    let none = Picture {
        width: 0,
        height: 0,
        pixels: vec![],
    };
    assert!(PictureLogits::read(&engine, &none, None, &[]).is_err());
}
