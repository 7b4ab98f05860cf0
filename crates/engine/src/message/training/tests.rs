//! Decoders that are trained read what they were not trained on.
use super::super::decoder::unit;
use super::*;

const WIDTH: usize = 48;

/// A text tower in miniature: random embeddings of tokens at positions, summed, off centre and normalised.
fn tower(sequences: &[[i64; CONTEXT]]) -> Result<Vec<f32>> {
    let mut features = Vec::new();
    for sequence in sequences {
        let mut row = [0.5_f32; WIDTH];
        for (position, &token) in sequence.iter().enumerate().filter(|(_, t)| **t > 0) {
            let mut rng = ChaCha20Rng::seed_from_u64(token as u64 * 100 + position as u64);
            row.iter_mut().for_each(|x| *x += 0.2 * (unit(&mut rng) - 0.5));
        }
        let norm = row.iter().map(|x| x * x).sum::<f32>().sqrt();
        features.extend(row.iter().map(|x| x / norm));
    }
    Ok(features)
}

/// Centred and scaled, with equal noise in all dimensions.
fn projection(table: &TokenTable, noise: f32) -> Projection {
    let mut rng = ChaCha20Rng::seed_from_u64(77);
    let sequences: Vec<_> = (0..200)
        .map(|_| {
            table
                .sequence(&Message::random(table.bits(), &mut rng).unwrap())
                .unwrap()
        })
        .collect();
    let mut projection = Projection::identity(WIDTH);
    let features = tower(&sequences).unwrap();
    for (i, mean) in projection.mean_text.iter_mut().enumerate() {
        *mean = features.iter().skip(i).step_by(WIDTH).sum::<f32>() / 200.0;
    }
    projection.matrix_text.iter_mut().for_each(|v| *v *= 20.0);
    projection.noise.iter_mut().step_by(WIDTH + 1).for_each(|v| *v = noise);
    projection
}

fn options() -> TrainingOptions {
    TrainingOptions {
        kind: DecoderKind::Perceptron,
        messages: 512,
        unseen: 64,
        epochs: Some(20),
        seed: 3,
        ..TrainingOptions::default()
    }
}

#[test]
fn unseen_messages_are_read_and_the_seed_decides() {
    let table = TokenTable::new(&[9; 32], 16, 1).unwrap();
    let projection = projection(&table, 0.1);
    let run = |seed| {
        let options = TrainingOptions { seed, ..options() };
        train(
            &table,
            &projection,
            tower,
            &options,
            &Device::flex(),
            &Stop::default(),
            |_| {},
        )
        .unwrap()
    };
    let first = run(3);
    assert_eq!(first.steps, 160);
    assert!(first.accuracy_seen > 0.99, "{first:?}");
    assert!(first.accuracy_unseen.unwrap() > 0.98, "{:?}", first.accuracy_unseen);
    assert!(
        first.accuracy_unseen_noisy.unwrap() > 0.95,
        "{:?}",
        first.accuracy_unseen_noisy
    );
    assert_eq!(run(3), first);
    assert_ne!(run(4).weights, first.weights);
}

#[test]
fn hard_messages_again_are_read_as_well() {
    let table = TokenTable::new(&[9; 32], 16, 1).unwrap();
    let projection = projection(&table, 0.1);
    let hard = TrainingOptions { hard: 0.5, ..options() };
    let run = |options: &TrainingOptions| {
        let (device, stop) = (Device::flex(), Stop::default());
        train(&table, &projection, tower, options, &device, &stop, |_| {}).unwrap()
    };
    let trained = run(&hard);
    assert!(trained.accuracy_unseen.unwrap() > 0.98, "{:?}", trained.accuracy_unseen);
    assert_ne!(trained.weights, run(&options()).weights);
    assert_eq!(trained.steps, 160);
}

#[test]
fn noise_costs_accuracy_and_none_costs_none() {
    let table = TokenTable::new(&[9; 32], 16, 1).unwrap();
    let run = |noise| {
        train(
            &table,
            &projection(&table, noise),
            tower,
            &options(),
            &Device::flex(),
            &Stop::default(),
            |_| {},
        )
        .unwrap()
    };
    let loud = run(8.0);
    assert!(
        loud.accuracy_unseen_noisy < loud.accuracy_unseen,
        "{:?}",
        loud.accuracy_unseen_noisy
    );
    let silent = run(0.0);
    assert_eq!(silent.accuracy_unseen_noisy, silent.accuracy_unseen);
}

#[test]
fn one_bit_has_nothing_unseen() {
    let table = TokenTable::new(&[9; 32], 1, 1).unwrap();
    let trained = train(
        &table,
        &projection(&table, 0.0),
        tower,
        &options(),
        &Device::flex(),
        &Stop::default(),
        |_| {},
    )
    .unwrap();
    assert_eq!(trained.accuracy_unseen, None);
    assert_eq!(trained.accuracy_seen, 1.0);
}

#[test]
fn failures_are_errors() {
    let table = TokenTable::new(&[9; 32], 8, 1).unwrap();
    let p = Projection::identity(WIDTH);
    let run = |encode: fn(&[[i64; CONTEXT]]) -> Result<Vec<f32>>, options: &TrainingOptions| {
        train(&table, &p, encode, options, &Device::flex(), &Stop::default(), |_| {})
            .unwrap_err()
            .to_string()
    };
    assert!(run(|_| Ok(vec![0.0; 3]), &options()).contains("3 numbers"));
    assert!(run(|s| Ok(vec![f32::NAN; s.len() * WIDTH]), &options()).contains("NaN"));
    let no_batch = TrainingOptions { batch: 0, ..options() };
    assert!(run(tower, &no_batch).contains("at least 1"));
    let bad_noise = TrainingOptions {
        noise: f32::NAN,
        ..options()
    };
    assert!(run(tower, &bad_noise).contains("noise"));
    let bad_share = TrainingOptions { hard: 1.5, ..options() };
    assert!(run(tower, &bad_share).contains("hard"));
}

#[test]
fn progress_is_told_to_the_end() {
    let table = TokenTable::new(&[9; 32], 8, 1).unwrap();
    let mut told = Vec::new();
    let options = TrainingOptions {
        epochs: Some(1),
        ..options()
    };
    train(
        &table,
        &projection(&table, 0.0),
        tower,
        &options,
        &Device::flex(),
        &Stop::default(),
        |p| told.push(p),
    )
    .unwrap();
    assert!(told.contains(&Progress::Encoding(256, 256)));
    assert!(matches!(told.last(), Some(Progress::Training(done, all)) if done == all));
}
