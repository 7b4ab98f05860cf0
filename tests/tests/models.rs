//! `models`: adding weights under a name, with the hash that they must have.
use guardsplat_tests::{Bench, shipped_clip};

/// The hash that the worker finds a folder's weights to have, from its refusal of another one.
fn hash_of(bench: &Bench, folder: &str) -> String {
    let output = bench.run(&format!("models add probe {folder} --sha256 {}", "0".repeat(64)));
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8(output.stderr).unwrap();
    let (_, rest) = told.split_once("has hash ").unwrap_or_else(|| panic!("{told}"));
    rest.split(',').next().unwrap().to_owned()
}

#[test]
fn models_are_added_listed_used_and_verified() {
    let bench = Bench::new();
    let folder = shipped_clip();
    let folder = folder.to_str().unwrap();
    assert_eq!(bench.json("models list --json", 0), serde_json::json!([]));
    let hash = hash_of(&bench, folder);
    assert_eq!(hash.len(), 64);
    assert!(bench.exits("models list", 0).contains("none were added"));

    bench.exits(&format!("models add other {folder} --sha256 {hash}"), 0);
    let list = bench.json("models list --json", 0);
    assert_eq!(list[0]["name"], "other");
    assert_eq!(list[0]["files"]["model.safetensors"]["sha256"], hash.as_str());
    assert!(bench.exits("models verify other", 0).starts_with("intact: other"));
    bench.refuses(
        &format!("models add other {folder} --sha256 {hash}"),
        &["model other", "there already"],
    );

    // A key names its CLIP, so what uses the key need not.
    let key = bench.json(
        "key create --bits 4 --seed 1 -o k.key --clip other --device cpu --json",
        0,
    );
    assert_eq!(key["clip"], "other");
    bench.exits("sample s.ply --gaussians 200 --sh-degree 0", 0);
    let read = bench.json("verify s.ply --key k.key --views 2 --size 32 --device cpu --json", 3);
    assert_eq!(read["clip"], "other");

    let weights = "home/models/other/model.safetensors";
    let mut damaged = bench.read(weights);
    let last = damaged.len() - 2;
    damaged[last] ^= 1;
    bench.write(weights, damaged);
    bench.refuses(
        "models verify other",
        &["model other", "model.safetensors has hash", &hash],
    );
    bench.refuses("models verify", &["model other"]);
    bench.refuses(
        "verify s.ply --key k.key --device cpu",
        &["key k.key", "belongs to the CLIP"],
    );
}

#[test]
fn what_is_no_model_is_refused() {
    let bench = Bench::new();
    let hash = "0".repeat(64);
    std::fs::create_dir(bench.path("folder")).unwrap();
    bench.write("weights.safetensors", "not weights");
    // The folder of models is made by the first attempt, and may stay.
    bench.run(&format!("models add other folder --sha256 {hash}"));
    for (rest, needles) in [
        ("other folder", &["no model.safetensors"][..]),
        ("other weights.safetensors", &["config.json does not exist"]),
        ("other none.safetensors", &["config.json does not exist"]),
        ("other http://localhost/model.safetensors", &["https"]),
        ("../other folder", &["a name has 1 to 64"]),
    ] {
        bench.refuses(&format!("models add {rest} --sha256 {hash}"), needles);
    }
    bench.refuses("models add other folder --sha256 12", &["64 hexadecimal digits"]);
    bench.refuses("models verify other", &["model other", "models add"]);
    bench.refuses(
        "key create --bits 4 -o k.key --clip other",
        &["model other", "models add"],
    );
}
