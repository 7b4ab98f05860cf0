//! Writes one report of each kind and verdict, made up, into a folder: `cargo run -p guardsplat-evidence --example
//! evidence FOLDER`.
mod samples;

use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args_os().nth(1).ok_or("name a folder to write to")?);
    std::fs::create_dir_all(&folder)?;
    for (name, evidence) in samples::all() {
        let signed = guardsplat_evidence::sign(&evidence, &samples::key())?;
        std::fs::write(folder.join(format!("{name}.json")), &signed.json)?;
        std::fs::write(folder.join(format!("{name}.html")), &signed.html)?;
        let checked = guardsplat_evidence::check(signed.html.as_bytes(), &samples::key().verifying_key());
        println!("{name}: {:?}, holds: {}", checked.answer, checked.holds());
    }
    println!("public key: {}", hex::encode(samples::key().verifying_key().as_bytes()));
    Ok(())
}
