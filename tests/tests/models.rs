//! `models`: adding weights under a name, with the hash that they must have.
use guardsplat_tests::{TestEnvironment, shipped_clip};

/// The hash that the worker finds a folder's weights to have, from its refusal of another one.
fn hash_of(environment: &TestEnvironment, folder: &str) -> String {
    let output = environment.run(&format!("models add probe {folder} --sha256 {}", "0".repeat(64)));
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8(output.stderr).unwrap();
    let (_, rest) = told.split_once("has hash ").unwrap_or_else(|| panic!("{told}"));
    rest.split(',').next().unwrap().to_owned()
}

#[test]
fn models_are_added_listed_used_and_verified() {
    let environment = TestEnvironment::new();
    let folder = shipped_clip();
    let folder = folder.to_str().unwrap();
    assert_eq!(environment.json("models list --json", 0), serde_json::json!([]));
    let hash = hash_of(&environment, folder);
    assert_eq!(hash.len(), 64);
    assert!(environment.exits("models list", 0).contains("none were added"));

    environment.exits(&format!("models add other {folder} --sha256 {hash}"), 0);
    let list = environment.json("models list --json", 0);
    assert_eq!(list[0]["name"], "other");
    assert_eq!(list[0]["files"]["model.safetensors"]["sha256"], hash.as_str());
    assert!(environment.exits("models verify other", 0).starts_with("intact: other"));
    environment.refuses(
        &format!("models add other {folder} --sha256 {hash}"),
        &["model other", "there already"],
    );

    // A key names its CLIP, so what uses the key need not.
    let key = environment.json(
        "key create --bits 4 --seed 1 -o k.key --clip other --device cpu --json",
        0,
    );
    assert_eq!(key["clip"], "other");
    environment.exits("sample s.ply --gaussians 200 --sh-degree 0", 0);
    // Four bits in a word of 64: what is read is judged by itself.
    let read = environment.json("verify s.ply --key k.key --views 2 --size 32 --device cpu --json", 2);
    assert_eq!((&read["clip"], &read["bits"]), (&"other".into(), &64.into()));

    let weights = "home/models/other/model.safetensors";
    let mut damaged = environment.read(weights);
    let last = damaged.len() - 2;
    damaged[last] ^= 1;
    environment.write(weights, damaged);
    environment.refuses(
        "models verify other",
        &["model other", "model.safetensors has hash", &hash],
    );
    environment.refuses("models verify", &["model other"]);
    environment.refuses(
        "verify s.ply --key k.key --device cpu",
        &["key k.key", "belongs to the CLIP"],
    );
}

#[test]
fn what_is_no_model_is_refused() {
    let environment = TestEnvironment::new();
    let hash = "0".repeat(64);
    std::fs::create_dir(environment.path("folder")).unwrap();
    environment.write("weights.safetensors", "not weights");
    // The folder of models is made by the first attempt, and may stay.
    environment.run(&format!("models add other folder --sha256 {hash}"));
    for (rest, needles) in [
        ("other folder", &["no model.safetensors"][..]),
        ("other weights.safetensors", &["config.json does not exist"]),
        ("other none.safetensors", &["config.json does not exist"]),
        ("other http://localhost/model.safetensors", &["https"]),
        ("../other folder", &["a name has 1 to 64"]),
    ] {
        environment.refuses(&format!("models add {rest} --sha256 {hash}"), needles);
    }
    environment.refuses("models add other folder --sha256 12", &["64 hexadecimal digits"]);
    environment.refuses("models verify other", &["model other", "models add"]);
    environment.refuses(
        "key create --bits 4 -o k.key --clip other",
        &["model other", "models add"],
    );
}
