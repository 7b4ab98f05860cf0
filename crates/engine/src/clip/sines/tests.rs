use super::*;
use crate::testing::wgpu;
use burn::tensor::{Device, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Pictures, filters, phases and a gradient, as flat lists, their sizes `[views, height, width, waves]`, and the side of
/// the squares that are averaged.
struct Case {
    side: usize,
    equalization: f32,
    sizes: [usize; 4],
    pictures: Vec<f32>,
    filters: Vec<f32>,
    phases: Vec<f32>,
    gradient: Vec<f32>,
}

/// Colours within 2.5 of 0, angles within about `3 * 2.5 * norm`.
fn case(sizes: [usize; 4], norm: f32, side: usize) -> Case {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut random = |count: usize, range: f32| -> Vec<f32> {
        (0..count).map(|_| range * (2.0 * rng.random::<f32>() - 1.0)).collect()
    };
    let [views, height, width, waves] = sizes;
    Case {
        side,
        equalization: 0.0,
        sizes,
        pictures: random(views * 3 * height * width, 2.5),
        filters: random(3 * waves, norm),
        phases: random(waves, 3.0),
        gradient: random(views * waves, 1.0),
    }
}

/// Means and the gradient to the pictures.
fn computed(case: &Case, device: &Device) -> [Vec<f32>; 2] {
    let [views, height, width, waves] = case.sizes;
    let device = device.clone().autodiff();
    let tensor = |values: &[f32], shape: Vec<usize>| TensorData::new(values.to_vec(), shape);
    let pictures = tensor(&case.pictures, vec![views, 3, height, width]);
    let pictures = Tensor::<4>::from_data(pictures, &device).require_grad();
    let filters = Tensor::<2>::from_data(tensor(&case.filters, vec![waves, 3]), &device);
    let phases = Tensor::<1>::from_data(tensor(&case.phases, vec![waves]), &device);
    let gradient = Tensor::<2>::from_data(tensor(&case.gradient, vec![views, waves]), &device);
    let means = mean_sines(pictures.clone(), filters, phases, vec![case.side], case.equalization);
    let found = (means.clone() * gradient).sum().backward();
    let numbers = |data: TensorData| data.iter::<f32>().collect();
    [
        numbers(means.into_data()),
        numbers(pictures.grad(&found).unwrap().into_data()),
    ]
}

/// The same in f64, written down as the formula stands.
fn reference(case: &Case) -> [Vec<f64>; 2] {
    let [views, height, width, waves] = case.sizes;
    let side = case.side;
    let (rows, columns) = (height / side, width / side);
    let share = 1.0 / (side * side) as f64;
    let mut means = vec![0.0; views * waves];
    let mut to_pictures = vec![0.0; case.pictures.len()];
    for view in 0..views {
        let inside = |square: usize, channel: usize| {
            let (top, left) = (square / columns * side, square % columns * side);
            let plane = (view * 3 + channel) * height * width;
            (0..side * side).map(move |i| plane + (top + i / side) * width + left + i % side)
        };
        let colour = |square: usize| -> [f64; 3] {
            std::array::from_fn(|channel| {
                let values = inside(square, channel).map(|at| f64::from(case.pictures[at]));
                values.sum::<f64>() * share
            })
        };
        let colours: Vec<[f64; 3]> = (0..rows * columns).map(colour).collect();
        let weights = weights_of(&colours, f64::from(case.equalization));
        for (square, (colours, weight)) in colours.iter().zip(weights).enumerate() {
            for wave in 0..waves {
                let filter = |channel: usize| f64::from(case.filters[3 * wave + channel]);
                let dot: f64 = (0..3).map(|c| filter(c) * colours[c]).sum();
                let angle = dot + f64::from(case.phases[wave]);
                means[view * waves + wave] += angle.sin() * weight;
                let slope = f64::from(case.gradient[view * waves + wave]) * angle.cos() * weight;
                for channel in 0..3 {
                    inside(square, channel).for_each(|at| to_pictures[at] += slope * filter(channel) * share);
                }
            }
        }
    }
    [means, to_pictures]
}

/// Weights of colours: the density of a colour is the sum over all corners of a grid of what the corner has of it, times
/// what it has of all.
fn weights_of(colours: &[[f64; 3]], equalization: f64) -> Vec<f64> {
    let hat = |value: f64, corner: i32| (1.0 - (value.clamp(-2.0, 3.0) - f64::from(corner)).abs()).max(0.0);
    let axis = -2..=3;
    let corners = axis
        .clone()
        .flat_map(|r| axis.clone().flat_map(move |g| (-2..=3).map(move |b| [r, g, b])));
    let mut densities = vec![0.0; colours.len()];
    for corner in corners {
        let has = |colour: &[f64; 3]| -> f64 { (0..3).map(|c| hat(colour[c], corner[c])).product() };
        let all: f64 = colours.iter().map(has).sum();
        densities
            .iter_mut()
            .zip(colours)
            .for_each(|(density, colour)| *density += has(colour) * all);
    }
    let rarities: Vec<f64> = densities.iter().map(|density| density.powf(-equalization)).collect();
    let sum: f64 = rarities.iter().sum();
    rarities.iter().map(|rarity| rarity / sum).collect()
}

fn largest_gap(found: &[f32], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let gaps = found.iter().zip(expected).map(|(f, e)| (f64::from(*f) - e).abs());
    gaps.fold(0.0, |a, b| if b.is_nan() { f64::INFINITY } else { a.max(b) })
}

fn agrees(device: &Device) {
    // Less than a block of lanes, less than a chunk, several chunks with a rest; squares that do not fill a picture.
    for (sizes, side) in [
        ([1, 3, 2, 1], 1),
        ([2, 9, 31, 5], 1),
        ([3, 47, 53, 20], 1),
        ([2, 47, 53, 20], 2),
        ([1, 9, 31, 5], 4),
    ] {
        for (norm, equalization) in [(1.0, 0.0), (23.0, 0.0), (400.0, 0.0), (1.0, 1.0), (23.0, 0.2)] {
            let case = Case {
                equalization,
                ..case(sizes, norm, side)
            };
            let ([means, slopes], [true_means, true_slopes]) = (computed(&case, device), reference(&case));
            // An angle of a is rounded to a * 6e-8 before any sine is taken.
            let tolerance = 2e-6 + 7.5 * f64::from(norm) * 2e-7;
            let gap = largest_gap(&means, &true_means);
            assert!(gap < tolerance, "{sizes:?} {side} {norm} {equalization}: {gap}");
            let largest = true_slopes.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
            let gap = largest_gap(&slopes, &true_slopes) / largest;
            assert!(gap < 4.0 * tolerance, "{sizes:?} {side} {norm} {equalization}: {gap}");
        }
    }
}

#[test]
fn the_cpu_agrees_with_the_formula() {
    agrees(&Device::flex());
}

#[test]
fn wgpu_agrees_with_the_formula() {
    if let Some(compute) = wgpu() {
        agrees(&compute.device);
    }
}

/// Several scales at once are those of each by itself; the gradient is the sum of theirs.
fn scales_are_put_together(device: &Device, exactly: bool) {
    let all = case([2, 47, 53, 12], 23.0, 1);
    let sides = [1, 4, 2];
    let one = |scale: usize| Case {
        side: sides[scale],
        equalization: 0.2,
        sizes: [2, 47, 53, 4],
        pictures: all.pictures.clone(),
        filters: all.filters[12 * scale..12 * (scale + 1)].to_vec(),
        phases: all.phases[4 * scale..4 * (scale + 1)].to_vec(),
        gradient: [0, 1].map(|view| &all.gradient[12 * view + 4 * scale..][..4]).concat(),
    };
    let alone = [0, 1, 2].map(|scale| computed(&one(scale), device));
    let autodiff = device.clone().autodiff();
    let tensor = |values: &[f32], shape: Vec<usize>| TensorData::new(values.to_vec(), shape);
    let pictures = Tensor::<4>::from_data(tensor(&all.pictures, vec![2, 3, 47, 53]), &autodiff).require_grad();
    let filters = Tensor::<2>::from_data(tensor(&all.filters, vec![12, 3]), &autodiff);
    let phases = Tensor::<1>::from_data(tensor(&all.phases, vec![12]), &autodiff);
    let gradient = Tensor::<2>::from_data(tensor(&all.gradient, vec![2, 12]), &autodiff);
    let means = mean_sines(pictures.clone(), filters, phases, sides.to_vec(), 0.2);
    let found = (means.clone() * gradient).sum().backward();
    let means: Vec<f32> = means.into_data().iter::<f32>().collect();
    for (at, mean) in means.iter().enumerate() {
        let (view, wave) = (at / 12, at % 12);
        assert_eq!(*mean, alone[wave / 4][0][4 * view + wave % 4]);
    }
    let to_pictures: Vec<f32> = pictures.grad(&found).unwrap().into_data().iter::<f32>().collect();
    for (at, found) in to_pictures.iter().enumerate() {
        let sum = alone[2][1][at] + alone[1][1][at] + alone[0][1][at];
        assert!(
            if exactly {
                *found == sum
            } else {
                (found - sum).abs() < 1e-6
            },
            "{at}: {found} {sum}"
        );
    }
}

#[test]
fn scales_are_put_together_on_the_cpu() {
    scales_are_put_together(&Device::flex(), true);
}

#[test]
fn scales_are_put_together_on_wgpu() {
    if let Some(compute) = wgpu() {
        scales_are_put_together(&compute.device, false);
    }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let case = Case {
        equalization: 0.2,
        ..case([2, 47, 53, 20], 23.0, 2)
    };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| computed(&case, &Device::flex()))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn what_is_no_number_stays_none() {
    let mut case = case([1, 4, 4, 2], 10.0, 1);
    case.pictures[3] = f32::NAN;
    let [means, _] = computed(&case, &Device::flex());
    assert!(means.iter().all(|m| m.is_nan()));
}
