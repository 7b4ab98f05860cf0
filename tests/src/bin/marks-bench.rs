//! Marks scenes and reads the marks back, as a table: what README says of marks is made by this.
//!
//! `cargo run --release --bin marks-bench -- SCENE[@PRESET]...` (which needs
//! `cargo build --release --workspace` before); `sample:SEED` is a sample of 50,000 Gaussians. Key and message are always
//! the same: 32 bits, seed 1, 8f3a5c71.
use std::path::Path;

use guardsplat_tests::TestEnvironment;
use serde_json::Value;

const MESSAGE: &str = "8f3a5c71";

fn main() {
    let environment = TestEnvironment::new();
    environment.exits("key create --bits 32 --seed 1 -o k.key --device cpu", 0);
    println!(
        "| scene | preset | Gaussians | seen | bits of a picture | worst picture | message | PSNR | SSIM | view-steps | seconds | \
         peak, predicted MB | unmarked |\n|{}",
        "---|".repeat(13)
    );
    for argument in std::env::args().skip(1) {
        let (scene, preset) = argument.split_once('@').unwrap_or((&argument, "standard"));
        println!("{}", row(&environment, scene, preset));
    }
}

/// Marks one scene; the unmarked one is read first.
fn row(environment: &TestEnvironment, scene: &str, preset: &str) -> String {
    let (name, input) = match scene.strip_prefix("sample:") {
        Some(seed) => {
            environment.exits(&format!("sample in.ply --gaussians 50000 --seed {seed}"), 0);
            (format!("sample of seed {seed}"), "in.ply".to_owned())
        }
        None => {
            let file = Path::new(scene).file_name().unwrap_or_default();
            let input = std::path::absolute(scene).expect("a path");
            (file.to_string_lossy().into_owned(), input.display().to_string())
        }
    };
    // The output is to have the name of its format.
    let output = format!("out-{name}").replace(' ', "-");
    let output = if scene.starts_with("sample:") {
        "out.ply".to_owned()
    } else {
        output
    };
    let before = json(
        environment,
        &format!("verify {input} --key k.key --message {MESSAGE} --device cpu --json"),
    );
    let report = json(
        environment,
        &format!(
            "embed {input} {output} --key k.key --message {MESSAGE} --preset {preset} --device cpu --json --force"
        ),
    );
    let number = |field: &str| report[field].as_f64().unwrap_or(f64::NAN);
    let right = if report["message_recovered"] == true {
        "right"
    } else {
        "wrong"
    };
    format!(
        "| `{name}` | {preset} | {} | {} | {:.1} % | {:.1} % | {right} | {:.2} dB | {:.4} | {} | {:.0} | {:.0}, {:.0} | {} |",
        report["gaussians"],
        report["seen_gaussians"],
        100.0 * number("bit_accuracy"),
        100.0 * number("bit_accuracy_worst_view"),
        number("psnr_db"),
        number("ssim"),
        report["view_steps"],
        number("seconds"),
        number("peak_memory_bytes") / 1e6,
        number("predicted_memory_bytes") / 1e6,
        before["matched_bits"],
    )
}

/// What a command prints that may also end with a verdict or a missed target.
fn json(environment: &TestEnvironment, line: &str) -> Value {
    let output = environment.run(line);
    assert!(
        matches!(output.status.code(), Some(0 | 2 | 3)),
        "{line}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).expect("a report")
}
