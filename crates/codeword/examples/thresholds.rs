//! What a claim about 64 bits needs at one in a million: the tables of docs/verify.md and docs/security.md.
use guardsplat_codeword::{DEFAULT_FALSE_POSITIVE_RATE, Result, signed_rank};

const BITS: u32 = 64;
/// How a suspect was read, with what such a reading pays (`shares`).
const READINGS: [(&str, u64); 6] = [
    ("a scene, read in one way", 1),
    ("pictures, as given", 2),
    ("pictures, as estimated", 4),
    ("a picture, the best of three next estimates", 8 * 3),
    ("a picture, the best of 279 guesses", 8 * 279),
    ("several pictures, the best of 512 in which one leads", 8 * 512),
];
/// Assets of the key.
const ASSETS: [u64; 5] = [1, 100, 10_000, 100_000, 1_000_000];

fn main() -> Result<()> {
    let all = signed_rank::largest(BITS);
    println!("rank sum of {all} that a match needs, as a share; bits that may be wrong, the least clear of all");
    println!("by assets of the key: {ASSETS:?}");
    for (name, tries) in READINGS {
        print!("{name:<53}");
        for assets in ASSETS {
            match signed_rank::least(BITS, DEFAULT_FALSE_POSITIVE_RATE, tries * assets)? {
                Some(least) => {
                    let wrong = (0..=BITS)
                        .rev()
                        .find(|wrong| signed_rank::largest(*wrong) <= all - least);
                    let share = 100.0 * f64::from(least) / f64::from(all);
                    print!(" | {least:>4} {share:>5.1} % {:>2}", wrong.unwrap_or(0));
                }
                None => print!(" | none"),
            }
        }
        println!();
    }
    Ok(())
}
