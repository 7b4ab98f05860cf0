//! The binary: commands, exit codes, JSON and messages.
mod bench;
mod formats;
mod inspect;
mod refusals;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

use guardsplat_engine::testing::tiny;

fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A folder with a tiny CLIP in it.
struct Bench(tempfile::TempDir);

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        tiny::write(&folder.path().join("clip"));
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, line: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_guardsplat-worker"))
            .args(line.split(' '))
            .current_dir(self.0.path())
            .env("GUARDSPLAT_CLIP", self.path("clip"))
            .env("GUARDSPLAT_HOME", self.path("home"))
            .env_remove("RUST_LOG")
            .output()
            .unwrap()
    }

    /// Standard output of a command that must exit with `code`.
    fn exits(&self, line: &str, code: i32) -> String {
        let output = self.run(line);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// What a command says that must fail.
    fn fails(&self, line: &str) -> String {
        let output = self.run(line);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{line}: {stderr}");
        assert!(stderr.starts_with("error: "), "{line}: {stderr}");
        stderr
    }

    fn json(&self, line: &str, code: i32) -> Value {
        serde_json::from_str(&self.exits(line, code)).unwrap()
    }
}

fn write(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
}

#[test]
fn from_a_sample_to_a_verdict() {
    let bench = Bench::new();
    bench.exits("sample in.ply --gaussians 500 --sh-degree 1 --seed 2", 0);
    let key = bench.json("key create --bits 32 --seed 7 -o k.key --device cpu --json", 0);
    assert_eq!((&key["bits"], &key["clip"]), (&32.into(), &"guardsplat-2".into()));

    write(
        &bench.path("few.json"),
        r#"{"steps": 2, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null,
            "verify": {"views": 6, "message_views": 5}}"#,
    );
    let line = "embed in.ply out.ply --key k.key --message 0123abcd --preset draft --device cpu --size 32 \
                --settings few.json --json";
    // Two steps are too few: the target is missed and nothing is there.
    let missed = bench.json(line, 3);
    assert_eq!(missed["written"], false);
    assert!(!bench.path("out.ply").exists());
    let report = bench.json(&format!("{line} --force --report pictures"), 3);
    for field in ["bit_accuracy", "bit_accuracy_worst_view", "psnr_db", "ssim", "seconds"] {
        assert!(report[field].is_number(), "{field}: {report}");
    }
    assert_eq!(report["steps"], 2);
    assert_eq!(report["view_steps"], 4);
    assert!(report["lpips"].is_null());
    assert_eq!(report["identical"], false);
    assert_eq!(
        (&report["device"], &report["clip"]),
        (&"cpu".into(), &"guardsplat-2".into())
    );
    assert_eq!(report["message"].as_str().unwrap().len(), 8);
    assert!(report["message_recovered"].is_boolean());
    assert_eq!(files(&bench.path("pictures")), ["comparison.png"]);

    bench.exits("render out.ply views --views 3 --size 40 --seed 1", 0);
    assert_eq!(
        files(&bench.path("views")),
        ["cameras.json", "view_000.png", "view_001.png", "view_002.png"]
    );
    bench.exits(
        "render out.ply again --cameras views/cameras.json --views 2 --background black --format exr",
        0,
    );
    assert_eq!(
        files(&bench.path("again")),
        ["cameras.json", "view_000.exr", "view_001.exr"]
    );

    // What pictures read is what they read again, so it matches; its complement does not.
    let read = bench.json("verify views --key k.key --device cpu --json", 3);
    assert_eq!((&read["verdict"], &read["views"]), (&"inconclusive".into(), &3.into()));
    assert!(read["p_value"].is_null() && read["reason"].is_string());
    let found = read["message"].as_str().unwrap().to_owned();
    // The message is what the logits of all views add up to.
    assert!(read["logits"].is_null());
    let read = bench.json("verify views --key k.key --device cpu --json --logits", 3);
    let views = read["logits"].as_array().unwrap();
    assert_eq!(views.len(), 3);
    let bits = (0..32).map(|bit| views.iter().map(|view| view[bit].as_f64().unwrap()).sum::<f64>() > 0.0);
    let message = bits.fold(0_u32, |message, bit| message << 1 | u32::from(bit));
    assert_eq!(format!("{message:08x}"), found);
    let matching = format!("verify views --key k.key --device cpu --json --message {found}");
    let verdict = bench.json(&matching, 0);
    assert_eq!(verdict["verdict"], "match");
    assert_eq!((&verdict["matched_bits"], &verdict["bits"]), (&32.into(), &32.into()));
    assert!(verdict["p_value"].as_f64().unwrap() <= verdict["threshold"].as_f64().unwrap());
    // A picture and a scene, together.
    let line = "verify views/view_000.png out.ply --key k.key --device cpu --views 3 --size 40 --seed 1 --json";
    assert_eq!(bench.json(line, 3)["views"], 4);
    // A scene is read as pictures of 800 px, not of 40.
    let line = "verify out.ply --key k.key --device cpu --views 3 --size 40 --seed 1";
    let found = bench.json(&format!("{line} --json"), 3)["message"]
        .as_str()
        .unwrap()
        .to_owned();
    let other = u32::from_str_radix(&found, 16).unwrap() ^ u32::MAX;
    assert!(
        bench
            .exits(&format!("{line} --message {other:08x}"), 2)
            .starts_with("no match: 0 of 32 bits")
    );
}

#[test]
fn a_convolutional_decoder_takes_the_place_of_a_clip() {
    let bench = Bench::new();
    bench.exits("sample in.ply --gaussians 300 --sh-degree 1 --seed 2", 0);
    let create = "key create --bits 8 --extractor hidden --seed 7 --device cpu";
    let key = bench.json(&format!("{create} --steps 2 -o k.key --json"), 0);
    assert_eq!((&key["bits"], &key["clip"]), (&8.into(), &"hidden".into()));
    assert!(key["bit_accuracy_unseen"].is_number(), "{key}");
    write(
        &bench.path("few.json"),
        r#"{"steps": 2, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null,
            "verify": {"views": 3, "message_views": 2}, "target": {"bit_accuracy": 0, "psnr_db": 0, "message": false}}"#,
    );
    let line = "embed in.ply out.ply --key k.key --message 5c --size 32 --settings few.json --device cpu --json";
    let report = bench.json(&format!("{line} --learn dc --ring 20"), 0);
    assert_eq!(report["clip"], "hidden");
    let verdict = bench.json("verify out.ply --key k.key --views 3 --size 32 --device cpu --json", 3);
    assert_eq!((&verdict["clip"], &verdict["views"]), (&"hidden".into(), &3.into()));
    assert_eq!(verdict["message"], report["message"]);
    for (line, needle) in [
        (format!("{create} --clip other -o a.key"), "clip: it is of keys"),
        (format!("{create} --decoder linear -o a.key"), "decoder: it is of keys"),
        (format!("{create} --steps 0 -o a.key"), "steps: 0 is outside"),
        (
            "key create --bits 8 --steps 5 -o a.key".into(),
            "steps: they are of the conv",
        ),
        (
            "verify out.ply --key k.key --clip guardsplat --device cpu".into(),
            "without a CLIP",
        ),
        (
            line.replace("--json", "--ring 85"),
            "ring.elevation: 85 is outside -80 to 80",
        ),
    ] {
        let told = bench.fails(&line);
        assert!(told.contains(needle), "{line}: {told}");
    }
    assert!(!bench.path("a.key").exists());
}

/// A scene that can't fit is refused by its first bytes: the rest of it is not even on the disk.
#[test]
fn a_budget_of_memory_is_kept() {
    let bench = Bench::new();
    bench.exits("sample in.ply --gaussians 50 --sh-degree 0", 0);
    bench.exits("key create --bits 8 --seed 7 -o k.key --device cpu", 0);
    let small = std::fs::read(bench.path("in.ply")).unwrap();
    let header = small.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let text = std::str::from_utf8(&small[..header]).unwrap();
    let row = 4 * text.matches("property float ").count() as u64;
    let promised = text.replace("element vertex 50\n", "element vertex 20000000\n");
    write(&bench.path("vast.ply"), &promised);
    let vast = std::fs::File::options()
        .write(true)
        .open(bench.path("vast.ply"))
        .unwrap();
    vast.set_len(promised.len() as u64 + 20_000_000 * row).unwrap();

    let before = files(bench.0.path());
    for line in [
        "embed vast.ply out.ply --key k.key --message 5c --device cpu",
        "verify vast.ply --key k.key --message 5c --device cpu",
        "render vast.ply views --views 1 --device cpu",
    ] {
        let told = bench.fails(&format!("{line} --memory 1024"));
        for words in ["does not fit", "20000000 Gaussians", "GiB", "its budget is 1.0 GiB"] {
            assert!(told.contains(words), "{line}: {told}");
        }
        assert_eq!(files(bench.0.path()), before, "{line}");
    }
    // The same budget is enough for a small scene, and the least is too little.
    bench.exits("render in.ply views --views 1 --size 32 --device cpu --memory 1024", 0);
    let told = bench.fails("verify in.ply --key k.key --message 5c --device cpu --memory 1");
    assert!(told.contains("its budget is 1 MiB"), "{told}");
}

#[test]
fn eight_bits_can_never_be_conclusive_and_models_are_listed() {
    let bench = Bench::new();
    bench.exits("sample in.ply --gaussians 50 --sh-degree 0", 0);
    bench.exits("key create --bits 8 --seed 7 -o k.key --device cpu", 0);
    let told = bench.exits(
        "verify in.ply --key k.key --message 5c --device cpu --views 2 --size 32",
        3,
    );
    assert!(told.contains("can never reach"), "{told}");
    assert!(bench.exits("models list", 0).contains("none were added"));
    assert_eq!(bench.exits("models list --json", 0).trim(), "[]");
    assert!(bench.exits("--help", 0).contains("Exit codes"));
}

#[test]
fn old_names_of_settings_are_heeded_and_warned_about() {
    let bench = Bench::new();
    bench.exits("sample in.ply --gaussians 200 --sh-degree 0 --seed 2", 0);
    bench.exits("key create --bits 8 --seed 7 -o k.key --device cpu", 0);
    let names = [
        ("old", r#""descent": null, "adam": {"rate_dc": 0.05}"#),
        ("new", r#""optimizer": {"adam": {"rate_dc": 0.05}}"#),
    ];
    let warned = names.map(|(name, optimizer)| {
        let few = format!(
            r#"{{"steps": 2, "views_per_step": 1, "fresh_per_step": 1, "early_stop": null,
                "verify": {{"views": 1, "message_views": 1}}, {optimizer}}}"#
        );
        write(&bench.path(&format!("{name}.json")), &few);
        let output = bench.run(&format!(
            "embed in.ply {name}.ply --key k.key --message 5c --size 32 --settings {name}.json --device cpu --force"
        ));
        assert_eq!(
            output.status.code(),
            Some(3),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8_lossy(&output.stderr).contains("the old name still works")
    });
    assert_eq!(warned, [true, false]);
    let [old, new] = ["old.ply", "new.ply"].map(|name| std::fs::read(bench.path(name)).unwrap());
    assert_eq!(old, new);
    assert_ne!(old, std::fs::read(bench.path("in.ply")).unwrap());
}
