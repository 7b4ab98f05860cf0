//! A sample before a photograph, seen by cameras that nobody tells.
use burn::tensor::Tensor;
use guardsplat_codeword::{Message, RegisteredTones};

use super::*;
use crate::device::{DeviceChoice, open};
use crate::embed::{Preset, Settings, optimise};
use crate::extract::{Extractor, PooledLogits};
use crate::sample::sample;
use crate::view::Split;

const SIDE: u32 = 240;

/// Reads the mean of each channel.
struct Means;

impl Extractor for Means {
    fn bits(&self) -> usize {
        3
    }

    fn side(&self) -> usize {
        SIDE as usize
    }

    fn parameters(&self) -> usize {
        0
    }

    fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        let [count, channels, height, width] = pictures.dims();
        let flat = pictures.reshape([count, channels, height * width]);
        Ok(flat.mean_dim(2).reshape([count, channels]))
    }
}

fn engine() -> Engine {
    Engine::with_extractor(open(DeviceChoice::Cpu).unwrap(), Box::new(Means), None)
}

/// A view of a scene, changed, before squares of many colours.
fn before_squares(original: &Original<'_>, camera: &Camera, changed: impl Fn([f32; 3]) -> [f32; 3]) -> Picture {
    let backgrounds = [[0.0; 3], [1.0; 3]];
    let [black, white] = original
        .engine
        .pictures(&original.geometry, camera, backgrounds)
        .unwrap();
    let (black, white) = (black.pixels.as_chunks::<3>().0, white.pixels.as_chunks::<3>().0);
    let pixel = |i: usize| -> [f32; 3] {
        let square = (i % SIDE as usize / 31 + 5 * (i / SIDE as usize / 23)) % 7;
        let behind = [0.9, 0.1, 0.6, 0.3, 0.75, 0.2, 0.5].map(|v: f32| (v + 0.13 * square as f32) % 1.0);
        let shows = white[i][1] - black[i][1];
        let seen: [f32; 3] = std::array::from_fn(|k| black[i][k] + shows * behind[k]);
        if shows < 0.5 { changed(seen) } else { seen }
    };
    Picture {
        width: SIDE,
        height: SIDE,
        pixels: (0..black.len()).flat_map(pixel).collect(),
    }
}

/// How far apart two cameras show the scene, pixels: the root of the mean square.
fn apart(gaussians: &Gaussians, a: &Camera, b: &Camera) -> f32 {
    let square = |point: &[f32; 3]| {
        let ([x, y], [u, v]) = (a.pixel(*point), b.pixel(*point));
        (x - u).powi(2) + (y - v).powi(2)
    };
    let positions = &gaussians.positions;
    (positions.iter().map(square).sum::<f32>() / positions.len() as f32).sqrt()
}

#[test]
fn the_right_view_is_among_the_first_guesses_as_it_is_and_with_other_tones() {
    let engine = engine();
    let gaussians = sample(4000, 1, 8).unwrap().into_gaussians();
    let original = Original::new(&engine, &gaussians, ViewSampler::new(&gaussians, 0).unwrap());
    let truth = original.sampler.camera(Split::Training, 17, SIDE);
    let changes: [fn([f32; 3]) -> [f32; 3]; 2] = [|c| c, |c| c.map(|v| 0.2 + 0.6 * v)];
    for changed in changes {
        let picture = before_squares(&original, &truth, changed);
        let found = guesses(&original, &picture, 2).unwrap();
        assert_eq!(found.len(), 2);
        assert!(
            found.iter().any(|camera| camera.rotation == truth.rotation),
            "{found:?}"
        );
    }
}

#[test]
fn the_camera_is_found_whatever_is_behind_the_scene_and_read_is_what_differs() {
    let engine = engine();
    let gaussians = sample(4000, 1, 8).unwrap().into_gaussians();
    let original = Original::new(&engine, &gaussians, ViewSampler::new(&gaussians, 0).unwrap());
    let truth = ViewSampler::new(&gaussians, 5).unwrap().camera(Split::HeldOut, 1, SIDE);
    let read = |changed: fn([f32; 3]) -> [f32; 3]| {
        let picture = before_squares(&original, &truth, changed);
        let found = original.register(&picture).unwrap().expect("the scene is shown");
        let off = apart(&gaussians, &truth, &found.camera);
        assert!(off < 1.5 && found.explained > 0.9, "{off} pixels, {found:?}");
        RegisteredTones::ALL.map(|tones| original.read(&picture, &found, tones).unwrap())
    };
    let [white] = engine.pictures(&original.geometry, &truth, [[1.0; 3]]).unwrap();
    let on_white = engine.read_logits(&[white]).unwrap().swap_remove(0);
    let near = |a: &[f32], b: &[f32], most: f32| a.iter().zip(b).all(|(a, b)| (a - b).abs() < most);
    // Nothing differs, and nothing of the squares is read.
    let [as_given, fitted] = read(|colour| colour);
    assert!(near(&as_given, &on_white, 0.01), "{as_given:?} {on_white:?}");
    assert!(near(&fitted, &on_white, 0.01), "{fitted:?} {on_white:?}");
    // A brighter red is read, and gone where tones are fitted.
    let [as_given, fitted] = read(|[r, g, b]| [r + 0.1, g, b]);
    assert!(as_given[0] > on_white[0] + 0.01, "{as_given:?} {on_white:?}");
    assert!(near(&as_given[1..], &on_white[1..], 0.01), "{as_given:?} {on_white:?}");
    assert!(near(&fitted, &on_white, 0.01), "{fitted:?} {on_white:?}");
}

/// Reads means of sines of colours, as the shipped tower does.
struct Ripples;

impl Extractor for Ripples {
    fn bits(&self) -> usize {
        16
    }

    fn side(&self) -> usize {
        128
    }

    fn parameters(&self) -> usize {
        0
    }

    fn reads_exact_colours(&self) -> bool {
        true
    }

    fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
        let [count, _, height, width] = pictures.dims();
        let flat = pictures.reshape([count, 3, height * width]);
        let ripple = |bit: usize| {
            let radians = [0, 1, 2].map(|k| 25.0 + 40.0 * ((7 * bit + 5 * k) % 11) as f32 / 11.0);
            let turned = |k: usize| flat.clone().narrow(1, k, 1) * radians[k];
            (turned(0) + turned(1) - turned(2))
                .sin()
                .mean_dim(2)
                .reshape([count, 1])
        };
        Ok(Tensor::cat((0..16).map(ripple).collect(), 1) * 60.0)
    }
}

#[test]
fn a_mark_that_compression_takes_from_the_tower_is_found_by_the_matched_filter() {
    let engine = Engine::with_extractor(open(DeviceChoice::Cpu).unwrap(), Box::new(Ripples), None);
    let scene = sample(4000, 1, 8).unwrap();
    let message = Message::parse("b1d2", 16).unwrap();
    let settings = Settings {
        steps: 40,
        extension: None,
        early_stop: None,
        ..Preset::Draft.settings()
    };
    let mark = optimise(&engine, &scene, &message, &settings, &[], &mut |_| {}).unwrap();
    let marked = Gaussians {
        sh: mark.learned.kept_colours(&scene.gaussians.sh),
        ..scene.gaussians.clone()
    };
    let original = Original::new(
        &engine,
        &scene.gaussians,
        ViewSampler::new(&scene.gaussians, 0).unwrap(),
    );
    let sampler = ViewSampler::new(&scene.gaussians, 5).unwrap();
    let read = |shown: &Gaussians| {
        let geometry = Geometry::new(shown);
        let pictures: Vec<RegisteredPicture> = (0..8)
            .map(|index| {
                let camera = sampler.camera(Split::HeldOut, index, 400);
                let [picture] = engine.pictures(&geometry, &camera, [[1.0; 3]]).unwrap();
                let registration = Registration {
                    camera,
                    explained: 1.0,
                    covered: 0.5,
                };
                RegisteredPicture::of(&compressed(&picture, 20), &registration).unwrap()
            })
            .collect();
        let logits = original.read_matched(&pictures).unwrap().expect("colours are compared");
        assert_eq!(logits.len(), 8);
        PooledLogits::new(logits).unwrap().reading().matches(&message).unwrap()
    };
    let (of_marked, of_original) = (read(&marked), read(&scene.gaussians));
    assert!(of_marked >= 13, "{of_marked} of 16");
    assert!((3..=13).contains(&of_original), "{of_original} of 16");
    assert_eq!(original.read_matched(&[]).unwrap(), None);
}

/// A picture after JPEG of this quality.
fn compressed(picture: &Picture, quality: u8) -> Picture {
    let bytes: Vec<u8> = picture.pixels.iter().map(|v| (255.0 * v).round() as u8).collect();
    let mut file = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, quality);
    let image = image::RgbImage::from_raw(picture.width, picture.height, bytes).unwrap();
    image.write_with_encoder(encoder).unwrap();
    crate::quality::decode_picture(&file, [1.0; 3]).unwrap()
}

#[test]
fn another_scene_is_not_found() {
    let engine = engine();
    let scenes = [8, 9].map(|seed| sample(4000, 1, seed).unwrap().into_gaussians());
    let [original, other] = scenes
        .each_ref()
        .map(|gaussians| Original::new(&engine, gaussians, ViewSampler::new(gaussians, 0).unwrap()));
    let camera = other.sampler.camera(Split::HeldOut, 0, SIDE);
    let picture = before_squares(&other, &camera, |colour| colour);
    assert_eq!(original.register(&picture).unwrap(), None);
    // Nothing to see is nothing found, and no panic.
    for value in [0.0, 0.7] {
        let plain = Picture {
            width: 3,
            height: 7,
            pixels: vec![value; 63],
        };
        assert_eq!(original.register(&plain).unwrap(), None);
    }
}
