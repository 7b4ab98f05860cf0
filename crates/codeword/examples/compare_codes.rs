//! How often each code loses a payload, by the bit error rate of its readings: what the default was chosen by.
//!
//! Logits are Gaussian, with means that make the wanted share of them wrong; 200,000 words a row, or as many as the first
//! argument says. The column "wrong" is the share that was decoded to another payload than was sent.
use std::time::Instant;

use guardsplat_codeword::{Code, Decoded, Message};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn main() {
    let words: u32 = std::env::args()
        .nth(1)
        .and_then(|text| text.parse().ok())
        .unwrap_or(200_000);
    println!("code   bit errors   hard lost  hard wrong   soft lost  soft wrong   soft µs a word");
    for code in Code::ALL {
        // The mean at which a standard normal number plus it is negative so often.
        for (rate, mean) in [
            (0.01, 2.3263),
            (0.02, 2.0537),
            (0.03, 1.8808),
            (0.05, 1.6449),
            (0.08, 1.4051),
            (0.12, 1.1750),
        ] {
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let mut counts = [0_u32; 4];
            let mut seconds = 0.0;
            for _ in 0..words {
                let information = rng.random::<u64>() >> (64 - code.information_bits());
                let Ok(word) = code.encode(information) else { continue };
                let read: Vec<f32> = word.bits().map(|bit| noisy(bit, mean, &mut rng)).collect();
                let hard = Message::from_bits(&read.iter().map(|&l| l > 0.0).collect::<Vec<_>>());
                let hard = hard.and_then(|word| code.decode(&word)).ok().flatten();
                let started = Instant::now();
                let soft = code.decode_logits(&read).ok().flatten();
                seconds += started.elapsed().as_secs_f64();
                for (decoded, place) in [(hard, 0), (soft, 2)] {
                    let wrong = |d: &Decoded| d.information != information;
                    counts[place] += u32::from(decoded.as_ref().is_none_or(wrong));
                    counts[place + 1] += u32::from(decoded.as_ref().is_some_and(wrong));
                }
            }
            let [a, b, c, d] = counts.map(|count| f64::from(count) / f64::from(words));
            let time = seconds * 1e6 / f64::from(words);
            println!(
                "{:5}  {:>9.0}%  {a:>10.2e}  {b:>10.2e}  {c:>10.2e}  {d:>10.2e}   {time:>8.1}",
                name(code),
                rate * 100.0
            );
        }
    }
}

fn noisy(bit: bool, mean: f32, rng: &mut ChaCha8Rng) -> f32 {
    let noise: f32 = StandardNormal.sample(rng);
    if bit { mean + noise } else { noise - mean }
}

fn name(code: Code) -> String {
    format!("{}/{}", code.information_bits(), code.corrects())
}
