//! Augmentation of training views in the picture: the distortions that a mark is to stand.
//!
//! People compress pictures of some 800 pixels, and training views have 160: squares of JPEG's eight pixels would be five
//! times too large there, and every pixel would have the noise of twenty-five. So a view that something is done to is
//! enlarged first, and CLIP takes it in at its own size as always.
use std::collections::BTreeMap;

use burn::tensor::{Int, Tensor, TensorData};
use guardsplat_distortion::{DistortionKind, Draw, Layer};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::settings::Settings;
use crate::error::{Error, Result};
use crate::extract::Engine;
use crate::resize::resize;

/// What rotated pictures show in their corners.
pub(super) const CORNERS: [f32; 3] = [1.0; 3];

/// How far a ground may be from black or white.
const GROUND: f32 = 1e-3;

/// Distorts training views before their messages are read.
pub(super) struct ImageAugmentation {
    layer: Layer,
    /// Side of the pictures that are distorted.
    side: usize,
    /// Pictures of a step that are distorted; `None` for all.
    some: Option<usize>,
}

impl ImageAugmentation {
    /// Tones that whoever reads a picture corrections and undoes ([`crate::extract::corrections`]) are left as they are.
    pub fn new(settings: &Settings, engine: &Engine) -> Self {
        let mut layer = settings.layer();
        if engine.extractor.reads_exact_colours() {
            (layer.ranges.brightness, layer.ranges.contrast) = ([1.0; 2], [1.0; 2]);
        }
        Self {
            layer,
            side: settings.distorted_size.max(settings.size) as usize,
            some: settings.distorted_views,
        }
    }

    /// What is done to each of so many pictures.
    fn draws(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Draw> {
        let mut draws = self.layer.draw(count, rng);
        if let Some(some) = self.some.filter(|some| *some < count) {
            // The views that a step has drawn anew come first: a window that begins anywhere treats all alike.
            let first = rng.random_range(0..count);
            draws.rotate_left(first);
            draws[some..].fill(Draw::Clean);
            draws.rotate_right(first);
        }
        draws
    }

    /// Logits `[b, bits]` of pictures `[b, 3, h, w]`, each as it is or distorted; differentiable.
    ///
    /// # Errors
    /// Draws outside of their limits, which checked settings rule out.
    pub fn logits(&self, engine: &Engine, pictures: Tensor<4>, rng: &mut ChaCha8Rng) -> Result<Tensor<2>> {
        if self.layer.robust_to.of_pictures().next().is_none() {
            return read_each_at_one_size(engine, pictures, rng);
        }
        let draws = self.draws(pictures.dims()[0], rng);
        // One kind after the other, so that no picture is put into another order while it is large.
        let mut alike: BTreeMap<Option<DistortionKind>, Vec<usize>> = BTreeMap::new();
        for (position, draw) in draws.iter().enumerate() {
            alike.entry(draw.kind()).or_default().push(position);
        }
        let some = |positions: &[usize]| chosen(&pictures, positions);
        let mut parts = Vec::new();
        for (kind, positions) in &alike {
            if kind.is_none() {
                parts.push(read_each_at_one_size(engine, some(positions), rng)?);
                continue;
            }
            let done_to: Vec<Draw> = positions.iter().map(|&i| draws[i].clone()).collect();
            let large = resize(some(positions), self.side, self.side);
            let done = self.layer.apply_with(&done_to, large.clone(), CORNERS);
            let done = done.map_err(|e| Error::BadOption {
                field: "distortions",
                reason: e.to_string(),
            })?;
            parts.push(engine.logits(with_ground(&large, done, &done_to))?);
        }
        Ok(in_order(parts, alike.values().flatten()))
    }
}

/// Logits of pictures, each at one of the sizes at which pictures are read. All sizes have their turn in a step of as many
/// views, and the next step gives them to other views: every view at every size costs four times as much.
fn read_each_at_one_size(engine: &Engine, pictures: Tensor<4>, rng: &mut ChaCha8Rng) -> Result<Tensor<2>> {
    let [count, _, _, pixels] = pictures.dims();
    let sides = engine.sides(pixels);
    if sides.len() == 1 {
        return engine.logits(pictures);
    }
    let first = rng.random_range(0..sides.len());
    let mut groups = vec![Vec::new(); sides.len()];
    for position in 0..count {
        groups[(first + position) % sides.len()].push(position);
    }
    let mut parts = Vec::new();
    for (&side, positions) in sides.iter().zip(&groups).filter(|(_, positions)| !positions.is_empty()) {
        parts.push(engine.logits_at(side, chosen(&pictures, positions))?);
    }
    Ok(in_order(parts, groups.iter().flatten()))
}

/// The pictures at these positions.
fn chosen(pictures: &Tensor<4>, positions: &[usize]) -> Tensor<4> {
    let indices: Vec<i64> = positions.iter().map(|i| *i as i64).collect();
    let indices = Tensor::<1, Int>::from_data(TensorData::new(indices, [positions.len()]), &pictures.device());
    pictures.clone().select(0, indices)
}

/// The rows of all parts, where their pictures were; `positions` says that of each row.
fn in_order<'a>(parts: Vec<Tensor<2>>, positions: impl Iterator<Item = &'a usize>) -> Tensor<2> {
    let rows = Tensor::cat(parts, 0);
    let mut order = vec![0_i64; rows.dims()[0]];
    for (row, &position) in positions.enumerate() {
        order[position] = row as i64;
    }
    let order = TensorData::new(order, [rows.dims()[0]]);
    let order = Tensor::<1, Int>::from_data(order, &rows.device());
    rows.select(0, order)
}

/// Distorted pictures with the ground that they had, where it is black or white and has not moved: whoever reads a picture
/// makes its ground white ([`guardsplat_codeword::PhotometricCorrection::WhiteBackground`]). Noise that is cut at white would shift all of it.
fn with_ground(before: &Tensor<4>, after: Tensor<4>, draws: &[Draw]) -> Tensor<4> {
    let [b, _, h, w] = before.dims();
    let stays = |draw: &Draw| f32::from(matches!(draw, Draw::Noise(_) | Draw::Jpeg(_) | Draw::EightBit));
    let stays: Vec<f32> = draws.iter().map(stays).collect();
    let device = before.device();
    let stays = Tensor::<1>::from_data(TensorData::new(stays, [b]), &device).reshape([b, 1, 1, 1]);
    let plain = before.clone().detach();
    let black = plain.clone().max_dim(1).lower_equal_elem(GROUND);
    let white = plain.clone().min_dim(1).greater_equal_elem(1.0 - GROUND);
    let ground = black.float() + white.float();
    let ground = (ground * stays).expand([b, 3, h, w]);
    after.clone() + (plain - after) * ground
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::{Clip, ClipModel, ImageTower, Parts};
    use crate::device::{DeviceChoice, open};
    use crate::embed::Preset;
    use crate::message::key::Secret;
    use crate::message::{ClipIdentity, DecoderWeights, Decoding, Key, Projection};
    use crate::train::{TrainOptions, config, filters};
    use rand::SeedableRng;

    /// A small CLIP of the shipped kind and an untrained decoder of 8 bits.
    fn engine() -> Engine {
        let compute = open(DeviceChoice::Cpu).unwrap();
        let options = TrainOptions {
            filters: 16,
            dims: 8,
            text_width: 64,
            ..TrainOptions::default()
        };
        let config = config(&options);
        let mut model = ClipModel::init(&config, Parts::Image, &compute.device, 5);
        if let Some(ImageTower::RandomFourier(tower)) = model.visual {
            let (weights, phases) = filters(16 * 3, options.norm, options.luma, 1);
            model.visual = Some(ImageTower::RandomFourier(tower.with_filters(&weights, &phases)));
        }
        let nobody = ClipIdentity {
            name: String::new(),
            hash: String::new(),
        };
        let key = Key {
            secret: Secret::from_seed(1),
            coded_bits: None,
            bits_per_token: 1,
            seed: None,
            clip: nobody,
            decoding: Decoding::Clip {
                projection: Projection::identity(8),
                decoder: DecoderWeights::seeded(8, 8, 1),
            },
            accuracy_unseen: None,
            accuracy_unseen_noisy: None,
        };
        Engine::new(compute, Clip::from_model(config, String::new(), model), &key, None).unwrap()
    }

    #[test]
    fn noise_leaves_white_and_black_grounds_alone_and_nothing_else() {
        let device = engine().compute.device;
        // Left half white, a quarter black, a quarter grey.
        let level = |i: usize| match i % 8 {
            0..4 => 1.0,
            4..6 => 0.0,
            _ => 0.5,
        };
        let values: Vec<f32> = (0..2 * 3 * 64).map(level).collect();
        let before = Tensor::<4>::from_data(TensorData::new(values.clone(), [2, 3, 8, 8]), &device);
        let after = before.clone() * 0.9 + 0.02;
        let noise = Draw::Noise(guardsplat_distortion::Noise { sigma: 0.1, seed: 1 });
        let kept = with_ground(&before, after.clone(), &[noise, Draw::Blur(1.0)]);
        let (kept, after) = (
            kept.try_to_vec_as::<f32>().unwrap(),
            after.try_to_vec_as::<f32>().unwrap(),
        );
        for (i, value) in values.iter().enumerate() {
            let stays = i < 3 * 64 && *value != 0.5;
            assert_eq!(kept[i], if stays { *value } else { after[i] }, "{i}");
        }
    }

    #[test]
    fn views_with_pixels_to_spare_are_read_at_one_size_each_in_turns() {
        let engine = engine();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let count = 5;
        let values: Vec<f32> = (0..count * 3 * 240 * 240).map(|_| rng.random()).collect();
        let pictures = Tensor::<4>::from_data(TensorData::new(values, [count, 3, 240, 240]), &engine.compute.device);
        let sides = engine.sides(240);
        assert_eq!(sides, [160, 176, 200, 224]);
        let first = rng.clone().random_range(0..sides.len());
        let read = read_each_at_one_size(&engine, pictures.clone(), &mut rng).unwrap();
        let read = read.try_into_vec_as::<f32>().unwrap();
        for (position, row) in read.chunks_exact(8).enumerate() {
            let side = sides[(first + position) % sides.len()];
            let alone = engine.logits_at(side, chosen(&pictures, &[position])).unwrap();
            let alone = alone.try_into_vec_as::<f32>().unwrap();
            let apart = row.iter().zip(&alone).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(apart < 1e-4, "view {position} at {side} px: {row:?} {alone:?}");
        }
    }

    #[test]
    fn no_more_views_are_distorted_than_the_settings_say_and_all_have_their_turn() {
        let settings = Settings {
            robust_to: "jpeg,noise".parse().unwrap(),
            distorted_views: Some(2),
            ..Preset::Standard.settings()
        };
        let shown = ImageAugmentation::new(&settings, &engine());
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut times = [0; 8];
        for _ in 0..100 {
            let draws = shown.draws(8, &mut rng);
            let distorted: Vec<usize> = (0..8).filter(|&i| draws[i] != Draw::Clean).collect();
            assert!(distorted.len() <= 2, "{draws:?}");
            distorted.iter().for_each(|&i| times[i] += 1);
        }
        // Two of eight views, two of three draws: a sixth of the steps.
        assert!(times.iter().all(|&n| (5..35).contains(&n)), "{times:?}");
    }

    #[test]
    fn pictures_keep_their_order_and_those_that_nothing_is_done_to_their_bytes() {
        let engine = engine();
        let settings = Settings {
            robust_to: "jpeg,brightness".parse().unwrap(),
            distorted_size: 320,
            distorted_views: None,
            ..Preset::Standard.settings()
        };
        let shown = ImageAugmentation::new(&settings, &engine);
        let values: Vec<f32> = (0..6 * 3 * 64 * 64)
            .map(|i| 0.5 + 0.4 * (i as f32 * 0.013).sin() * (i as f32 * 0.0007).cos())
            .collect();
        let pictures = Tensor::<4>::from_data(TensorData::new(values, [6, 3, 64, 64]), &engine.compute.device);
        let host = |t: Tensor<2>| engine.to_host(t).unwrap();
        let plain = host(engine.logits(pictures.clone()).unwrap());
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let draws = shown.layer.draw(6, &mut rng.clone());
        let seen = host(shown.logits(&engine, pictures, &mut rng).unwrap());
        assert!(draws.contains(&Draw::Clean) && draws.iter().any(|d| matches!(d, Draw::Jpeg(_))));
        for (row, draw) in draws.iter().enumerate() {
            let (plain, seen) = (&plain[8 * row..][..8], &seen[8 * row..][..8]);
            let off = plain.iter().zip(seen).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let size = plain.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
            match draw {
                Draw::Clean => assert!(off < 1e-4 * size, "{row}: {off}"),
                Draw::Brightness(factor) => assert_eq!(*factor, 1.0),
                _ => assert!(off > 1e-2 * size, "{row}: {off}"),
            }
        }
    }
}
