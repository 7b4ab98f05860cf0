//! The codec with random weights, its formulas on numbers worked out by hand, and files that do not fit.
use std::collections::BTreeMap;

use safetensors::tensor::{Dtype, TensorView, serialize};

use super::*;
use crate::testing::*;

const SMALL: Channels = Channels { hidden: 4, latents: 6 };

type Tensors = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

/// Tensors as CompressAI names them, with random values of the size that keeps signals where they are.
fn tensors(Channels { hidden, latents }: Channels) -> Tensors {
    let mut all = Tensors::new();
    let mut put = |name: String, shape: Vec<usize>, centre: f32, spread: f32| {
        let seed = name
            .bytes()
            .fold(7, |seed: u64, byte| seed * 31 % 1_000_003 + u64::from(byte));
        let values = random(shape.iter().product(), centre - spread, centre + spread, seed);
        all.insert(name, (shape, values));
    };
    for (name, ends) in [("g_a", [3, latents]), ("g_s", [latents, 3])] {
        for i in 0..4 {
            let inputs = if i == 0 { ends[0] } else { hidden };
            let outputs = if i == 3 { ends[1] } else { hidden };
            let shape = match name {
                "g_a" => vec![outputs, inputs, 5, 5],
                _ => vec![inputs, outputs, 5, 5],
            };
            // Latents are made large, so that rounding does not erase them.
            let gain = if name == "g_a" && i == 3 { 12.0 } else { 1.0 };
            let spread = gain * (3.0 / (inputs as f32 * 25.0)).sqrt();
            put(format!("{name}.{}.weight", 2 * i), shape, 0.0, spread);
            put(format!("{name}.{}.bias", 2 * i), vec![outputs], 0.05, 0.05);
            if i < 3 {
                put(format!("{name}.{}.beta", 2 * i + 1), vec![hidden], 1.0, 0.2);
                put(format!("{name}.{}.gamma", 2 * i + 1), vec![hidden; 2], 0.1, 0.1);
            }
        }
    }
    put("entropy_bottleneck.quantiles".into(), vec![latents, 1, 3], 0.0, 0.5);
    all
}

fn file(tensors: &Tensors) -> Vec<u8> {
    let bytes: Vec<(&String, &Vec<usize>, Vec<u8>)> = tensors
        .iter()
        .map(|(name, (shape, values))| (name, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect()))
        .collect();
    let views = bytes.iter().map(|(name, shape, data)| {
        (
            name.as_str(),
            TensorView::new(Dtype::F32, shape.to_vec(), data).unwrap(),
        )
    });
    serialize(views, None).unwrap()
}

fn small() -> Vae {
    Vae::with_channels("small", &file(&tensors(SMALL)), SMALL, &Device::flex()).unwrap()
}

#[test]
fn normalisation_agrees_with_numbers_worked_out_by_hand() {
    // Two channels, one pixel: x = (3, 4). Norms are 1 + 0.5 * 9 + 0 * 16 = 5.5 and 2 + 1 * 9 + 0.25 * 16 = 15.
    let x = pictures(&[3.0, 4.0], [1, 2, 1, 1]);
    let made = |inverse| {
        let gdn = Gdn::new(vec![1.0, 2.0], vec![0.5, 0.0, 1.0, 0.25], inverse, &Device::flex());
        host(gdn.forward(x.clone()))
    };
    let close = |found: Vec<f32>, expected: [f32; 2]| {
        assert!(
            found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-5),
            "{found:?}"
        );
    };
    close(made(false), [1.279_204_3, 1.032_795_5]);
    close(made(true), [7.035_624, 15.491_934]);
}

#[test]
fn stored_numbers_are_reparametrised() {
    let pedestal = 2.0_f64.powi(-36);
    let stored: Vec<f32> = [2.0, 0.25, 0.0].map(|x: f64| (x + pedestal).sqrt() as f32).to_vec();
    let gamma = weights::not_negative(&stored, 0.0);
    assert!((gamma[0] - 2.0).abs() < 1e-6 && (gamma[1] - 0.25).abs() < 1e-7 && gamma[2].abs() < 1e-12);
    // Below the bound, negative ones included, it is the smallest value.
    for small in weights::not_negative(&[-3.0, 0.0, 1e-5], 1e-6) {
        assert!((small - 1e-6).abs() < 1e-12, "{small}");
    }
    assert_eq!(weights::not_negative(&[-3.0], 0.0), [0.0]);
}

#[test]
fn transforms_have_the_published_shapes_and_rounding_is_around_the_medians() {
    let vae = small();
    let input = random_pictures([2, 3, 32, 48], 1);
    let latents = vae.analyse(input.clone());
    assert_eq!(latents.dims(), [2, 6, 2, 3]);
    assert_eq!(vae.synthesise(latents.clone()).dims(), [2, 3, 32, 48]);
    // By hand on the host: every latent is a whole number away from the second quantile of its channel.
    let quantiles = &tensors(SMALL)["entropy_bottleneck.quantiles"].1;
    let rounded: Vec<f32> = host(latents.clone())
        .iter()
        .enumerate()
        .map(|(i, y)| {
            let median = quantiles[(i / 6 % 6) * 3 + 1];
            (y - median).round_ties_even() + median
        })
        .collect();
    assert!(rounded.iter().any(|y| y.abs() > 1.0));
    let expected = vae.synthesise(pictures(&rounded, latents.dims())).clamp(0.0, 1.0);
    let pairs = host(vae.reconstruct(input)).into_iter().zip(host(expected));
    for (found, expected) in pairs {
        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
    }
}

#[test]
fn any_size_is_padded_and_cut_back() {
    let vae = small();
    for (h, w) in [(1, 1), (16, 16), (17, 5), (33, 47)] {
        let input = random_pictures([1, 3, h, w], 2);
        let found = vae.reconstruct(input.clone());
        assert_eq!(found.dims(), [1, 3, h, w]);
        let values = host(found);
        assert!(values.iter().all(|v| (0.0..=1.0).contains(v)));
        assert_eq!(values, host(vae.reconstruct(input.clone())));
        // Padding by hand with the last row and column gives the same.
        let [height, width] = [h, w].map(|side: usize| side.next_multiple_of(16));
        let before = host(input);
        let at = |i: usize| {
            let (c, y, x) = (i / (height * width), i / width % height, i % width);
            before[(c * h + y.min(h - 1)) * w + x.min(w - 1)]
        };
        let padded: Vec<f32> = (0..3 * height * width).map(at).collect();
        let whole = host(vae.reconstruct(pictures(&padded, [1, 3, height, width])));
        for (i, value) in values.iter().enumerate() {
            let (c, y, x) = (i / (h * w), i / w % h, i % w);
            assert!((value - whole[(c * height + y) * width + x]).abs() < 1e-5);
        }
    }
}

#[test]
fn gradients_agree_with_central_differences() {
    let vae = small();
    let input = random_pictures([1, 3, 20, 30], 3);
    // Without rounding it is smooth.
    let [_, _, h, w] = input.dims();
    let smooth = |x: Tensor<4>| {
        let x = x.pad([(0, 32 - h), (0, 32 - w)], PadMode::Edge);
        vae.synthesise(vae.analyse(x)).slice([0..1, 0..3, 0..h, 0..w])
    };
    check_gradient(smooth, &input, 0.01, 2e-3);
    // With it gradients pass as if it were not there, though taken at the rounded latents; they are those of the
    // synthesis at these times those of the analysis.
    let weights = random(3 * h * w, -0.1, 0.1, 4);
    let found = gradient(|x| vae.reconstruct(x), &input, &weights);
    assert!(found.iter().all(|v| v.is_finite()) && found.iter().any(|v| v.abs() > 1e-4));
    let padded = input.clone().pad([(0, 32 - h), (0, 32 - w)], PadMode::Edge);
    let latents = vae.analyse(padded);
    let rounded = (latents.clone() - vae.medians.clone()).round() + vae.medians.clone();
    let at_latents = gradient(
        |y| vae.synthesise(y).slice([0..1, 0..3, 0..h, 0..w]).clamp(0.0, 1.0),
        &rounded,
        &weights,
    );
    let expected = gradient(
        |x| vae.analyse(x.pad([(0, 32 - h), (0, 32 - w)], PadMode::Edge)),
        &input,
        &at_latents,
    );
    for (found, expected) in found.iter().zip(&expected) {
        assert!(
            (found - expected).abs() < 1e-4 * (1.0 + expected.abs()),
            "{found} {expected}"
        );
    }
}

#[test]
fn the_published_size_loads_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bmshj2018-factorized-3.safetensors");
    let mut all = tensors(Channels::PUBLISHED);
    // Published files hold more than is needed.
    all.insert("entropy_bottleneck._offset".into(), (vec![192], vec![0.0; 192]));
    std::fs::write(&path, file(&all)).unwrap();
    let vae = Vae::load(&path, &Device::flex()).unwrap();
    let found = vae.reconstruct(random_pictures([1, 3, 16, 16], 5));
    assert_eq!(found.dims(), [1, 3, 16, 16]);
    assert!(host(found).iter().all(|v| v.is_finite()));
    let missing = Vae::load(&folder.path().join("none"), &Device::flex());
    assert!(matches!(missing, Err(Error::Io { .. })));
}

#[test]
fn errors_name_the_tensor() {
    let error = |change: &dyn Fn(&mut Tensors)| {
        let mut all = tensors(SMALL);
        change(&mut all);
        let found = Vae::with_channels("x.safetensors", &file(&all), SMALL, &Device::flex());
        found.err().unwrap().to_string()
    };
    let names: Vec<String> = tensors(SMALL).into_keys().collect();
    assert_eq!(names.len(), 29);
    for name in names {
        let missing = error(&|all| drop(all.remove(&name)));
        assert_eq!(missing, format!("x.safetensors: tensor {name} is missing"));
        let wrong = error(&|all| {
            all.insert(name.clone(), (vec![2], vec![0.0; 2]));
        });
        let start = format!("x.safetensors: tensor {name} has shape [2], must be [");
        assert!(wrong.starts_with(&start), "{wrong}");
    }
    let infinite = error(&|all| all.get_mut("g_s.2.bias").unwrap().1[3] = f32::INFINITY);
    assert_eq!(infinite, "x.safetensors: tensor g_s.2.bias is not finite at element 3");

    let parse = |bytes: &[u8]| Vae::from_bytes("y", bytes, &Device::flex()).err().unwrap().to_string();
    assert!(parse(&[]).contains("not a safetensors file"));
    assert!(parse(&u64::MAX.to_le_bytes()).contains("at most 1048576 are read"));
    assert!(
        parse(&file(&tensors(SMALL))).contains("must be ["),
        "the small one is not the published one"
    );
    let mut cut = file(&tensors(SMALL));
    cut.truncate(cut.len() - 1);
    assert!(parse(&cut).contains("not a safetensors file"));
    let doubles = [0; 6 * 3 * 8];
    let view = TensorView::new(Dtype::F64, vec![6, 1, 3], &doubles).unwrap();
    let bytes = serialize([("entropy_bottleneck.quantiles", view)], None).unwrap();
    let found = Vae::with_channels("z", &bytes, SMALL, &Device::flex()).err().unwrap();
    assert_eq!(
        found.to_string(),
        "z: tensor entropy_bottleneck.quantiles is F64, must be F32"
    );
}
