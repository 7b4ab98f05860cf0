//! What attacks do to a picture: a table of sizes and PSNR, as Markdown.
//!
//! `cargo run --example attacks -- picture.png [suite or attack ...]`
use std::time::Instant;

use guardsplat_evaluation::attack::{Attack, testing::psnr};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("needs the path of a picture")?;
    let picture = image::open(&path)?.into_rgb8();
    let mut attacks = Vec::new();
    for name in arguments {
        match Attack::SUITES.contains(&name.as_str()) {
            true => attacks.extend(Attack::suite(&name)?),
            false => attacks.push(name.parse()?),
        }
    }
    if attacks.is_empty() {
        attacks = Attack::suite("all")?;
    }
    println!("| attack | drawn | size | PSNR dB | ms |\n|---|---|---|---|---|");
    for attack in attacks {
        let start = Instant::now();
        let result = attack.apply(&picture, 0, 0)?;
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        let (width, height) = result.dimensions();
        let drawn = attack.drawn(0, 0);
        let drawn = if drawn == attack {
            String::new()
        } else {
            drawn.to_string()
        };
        let psnr = psnr(&picture, &result).map_or("-".into(), |psnr| format!("{psnr:.2}"));
        println!("| {attack} | {drawn} | {width}x{height} | {psnr} | {milliseconds:.1} |");
    }
    Ok(())
}
