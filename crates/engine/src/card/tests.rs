use super::*;
use crate::testing::wgpu;
use burn::tensor::{Device, TensorData};

/// Numbers between -1 and 1.
fn numbers(count: usize, seed: usize) -> Vec<f32> {
    (0..count)
        .map(|i| ((i * 37 + seed * 11) % 83) as f32 / 41.0 - 1.0)
        .collect()
}

fn tensor<const D: usize>(values: &[f32], shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values.to_vec(), shape), device)
}

/// What `operation` makes of `x`, and the gradient to it for some gradient to that, on a card and by burn's tensors on the CPU.
fn agree<const D: usize, const E: usize>(
    x: &[f32],
    shape: [usize; D],
    card: impl Fn(Tensor<D>, &Device) -> Tensor<E>,
    plain: impl Fn(Tensor<D>, &Device) -> Tensor<E>,
) {
    let Some(compute) = wgpu() else { return };
    let run = |device: Device, operation: &dyn Fn(Tensor<D>, &Device) -> Tensor<E>| {
        let device = device.autodiff();
        let input = tensor(x, shape, &device).require_grad();
        let out = operation(input.clone(), &device);
        let weights = numbers(out.shape().num_elements(), 5);
        let weights = tensor::<E>(&weights, out.dims(), &device);
        let gradients = (out.clone() * weights).sum().backward();
        [
            out.into_data().iter::<f32>().collect::<Vec<f32>>(),
            input
                .grad(&gradients)
                .unwrap()
                .into_data()
                .iter::<f32>()
                .collect::<Vec<f32>>(),
        ]
    };
    let found = run(compute.device, &card);
    let want = run(Device::flex(), &plain);
    for (found, want) in found.iter().zip(&want) {
        assert_eq!(found.len(), want.len());
        let largest = want.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
        let off = found.iter().zip(want).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(largest > 0.0 && off < 1e-5 * largest, "{off} of {largest}");
    }
}

#[test]
fn it_is_known_which_device_is_a_card() {
    assert!(!on_card(&tensor(&[1.0], [1], &Device::flex())));
    assert!(!on_card(&tensor(&[1.0], [1], &Device::flex().autodiff())));
    if let Some(compute) = wgpu() {
        assert!(on_card(&tensor(&[1.0], [1], &compute.device)));
        assert!(on_card(&tensor(&[1.0], [1], &compute.device.autodiff())));
    }
}

#[test]
fn affine_maps_are_those_of_tensors() {
    for (rows, width, columns) in [(1, 3, 2), (8, 768, 40), (5, 33, 300)] {
        let weights = numbers(width * columns, 1);
        let (means, biases) = (numbers(width, 2), numbers(columns, 3));
        for centred in [false, true] {
            let parts = |device: &Device| {
                let mean = centred.then(|| tensor(&means, [width], device));
                let bias = (!centred).then(|| tensor(&biases, [columns], device));
                (mean, tensor(&weights, [width, columns], device), bias)
            };
            agree(
                &numbers(rows * width, 4),
                [rows, width],
                |x, device| {
                    let (mean, weight, bias) = parts(device);
                    affine(x, mean, weight, bias)
                },
                |x, device| match parts(device) {
                    (Some(mean), weight, _) => (x - mean.unsqueeze()).matmul(weight),
                    (_, weight, bias) => x.matmul(weight) + bias.unwrap().unsqueeze(),
                },
            );
        }
    }
}

#[test]
fn products_of_many_rows_are_those_of_tensors() {
    for (batch, tokens, width, columns) in [(1, 33, 3, 2), (2, 50, 96, 200), (1, 130, 65, 63)] {
        let (weights, biases) = (numbers(width * columns, 1), numbers(columns, 3));
        for biased in [false, true] {
            let parts = |device: &Device| {
                let bias = biased.then(|| tensor(&biases, [columns], device));
                (tensor(&weights, [width, columns], device), bias)
            };
            agree(
                &numbers(batch * tokens * width, 4),
                [batch, tokens, width],
                |x, device| {
                    let (weight, bias) = parts(device);
                    linear(x, weight, bias)
                },
                |x, device| {
                    let (weight, bias) = parts(device);
                    burn::tensor::module::linear(x, weight, bias)
                },
            );
        }
    }
}

/// With a gradient to what the product is added to, and through both where they are one.
#[test]
fn products_are_added_to_what_they_came_from() {
    let (weights, biases) = (numbers(20 * 20, 1), numbers(20, 3));
    let of = |device: &Device| {
        let mut layer = burn::nn::LinearConfig::new(20, 20).init(device);
        layer.weight = layer.weight.map(|_| tensor(&weights, [20, 20], device));
        layer.bias = layer.bias.map(|bias| bias.map(|_| tensor(&biases, [20], device)));
        burn::module::Module::freeze(layer)
    };
    agree(
        &numbers(2 * 25 * 20, 4),
        [2, 25, 20],
        |x, device| layer_onto(&of(device), x.clone(), x),
        |x, device| x.clone() + of(device).forward(x),
    );
}

#[test]
fn layers_that_learn_keep_their_gradient() {
    let Some(compute) = wgpu() else { return };
    let device = compute.device.autodiff();
    let weight = tensor(&numbers(6, 1), [3, 2], &device).require_grad();
    let out = linear(tensor(&numbers(120, 2), [40, 3], &device), weight.clone(), None);
    assert!(weight.grad(&out.sum().backward()).is_some());
}

#[test]
fn unit_rows_are_those_of_tensors() {
    for (rows, width) in [(1, 3), (8, 512), (300, 7)] {
        agree(
            &numbers(rows * width, 4),
            [rows, width],
            |x, _| unit_rows(x, 1e-24),
            |x, _| {
                let squares = x.clone().square().sum_dim(1);
                x / squares.add_scalar(1e-24).sqrt()
            },
        );
    }
}

#[test]
fn standard_pictures_are_those_of_tensors() {
    let (mean, deviation) = ([0.5, 0.4, 0.3], [0.25, 0.3, 0.2]);
    agree(
        &numbers(2 * 3 * 5 * 7, 4),
        [2, 3, 5, 7],
        |x, _| standardize(x, mean, deviation),
        |x, device| {
            let channels = |values: [f32; 3]| Tensor::<1>::from_floats(values, device).reshape([1, 3, 1, 1]);
            (x - channels(mean)) / channels(deviation)
        },
    );
}

#[test]
fn cross_entropy_is_that_of_tensors_also_for_logits_beyond_measure() {
    let mut logits = numbers(8 * 64, 4);
    logits.iter_mut().for_each(|logit| *logit *= 30.0);
    (logits[0], logits[1], logits[2], logits[3]) = (400.0, -400.0, 0.0, 1e6);
    let targets: Vec<f32> = (0..64).map(|i| (i / 2 % 2) as f32).collect();
    for temperature in [1.0, 4.0] {
        agree(
            &logits,
            [8, 64],
            |x, device| cross_entropy(x, tensor(&targets, [1, 64], device), temperature),
            |x, device| {
                crate::message::bce_from_logits(x / temperature, tensor(&targets, [1, 64], device)) * temperature
            },
        );
    }
}

#[test]
fn attention_is_that_of_tensors() {
    for (batch, tokens, heads, dim) in [(1, 1, 1, 3), (2, 7, 3, 8), (3, 70, 2, 80)] {
        for causal in [false, true] {
            let width = heads * dim;
            agree(
                &numbers(batch * tokens * 3 * width, 4),
                [batch, tokens, 3 * width],
                |x, _| attend(x, heads, causal),
                |x, device| {
                    let [q, k, v] =
                        [0, 1, 2].map(|part| x.clone().slice([0..batch, 0..tokens, part * width..(part + 1) * width]));
                    let mask = Tensor::<2>::full([tokens, tokens], -1e9, device).triu(1).unsqueeze();
                    crate::clip::attention(q, k, v, heads, causal.then_some(&mask))
                },
            );
        }
    }
    assert!(attends(50, 64) && attends(577, 64) && !attends(2000, 64));
}

#[test]
fn gaussian_units_are_those_of_tensors() {
    let mut x = numbers(1000, 4);
    x.iter_mut().for_each(|x| *x *= 6.0);
    (x[0], x[1], x[2]) = (60.0, -60.0, 0.0);
    for quick in [false, true] {
        agree(
            &x,
            [10, 100],
            |x, _| gelu(x, quick),
            |x, _| match quick {
                true => crate::clip::config::Activation::QuickGelu.forward(x),
                false => crate::clip::config::Activation::Gelu.forward(x),
            },
        );
    }
}
