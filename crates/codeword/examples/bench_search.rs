//! How long it takes to find the nearest of 10,000 and of 1,000,000 registered words, for six hypotheses of a suspect.
use std::time::Instant;

use guardsplat_codeword::{Index, Message, MessageLength, Reading, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn main() -> Result<()> {
    println!("bits      words   best of 6 hypotheses, ms: least, median of 21   a word, ns");
    for bits in [64, 128, 150] {
        for words in [10_000_u64, 1_000_000] {
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let mut random = || Message::from_bits(&(0..bits).map(|_| rng.random()).collect::<Vec<bool>>());
            let mut index = Index::new(MessageLength::new(bits)?);
            for _ in 0..words {
                index.push(&random()?)?;
            }
            let readings = (0..6).map(|_| Ok(Reading::of(random()?))).collect::<Result<Vec<_>>>()?;
            let mut times = Vec::new();
            for _ in 0..21 {
                let started = Instant::now();
                std::hint::black_box(index.nearest(&readings, 10)?);
                times.push(started.elapsed().as_secs_f64() * 1e3);
            }
            times.sort_by(f64::total_cmp);
            let each = times[0] * 1e6 / (6.0 * words as f64);
            println!(
                "{bits:>4} {words:>10}   {:>10.3} {:>10.3}   {each:>10.2}",
                times[0], times[10]
            );
        }
    }
    Ok(())
}
