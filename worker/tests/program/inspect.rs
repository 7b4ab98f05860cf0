//! `inspect`: what a scene holds, what marking it will take, and its agreement with what `embed` says.
use super::{Bench, write};

#[test]
fn a_scene_can_be_inspected() {
    let bench = Bench::new();
    bench.exits("sample in.ply --gaussians 500 --sh-degree 1 --seed 2", 0);
    let found = bench.json("inspect in.ply --json", 0);
    assert_eq!(
        (&found["kind"]["found"], &found["kind"]["used"]),
        (&"object".into(), &"object".into())
    );
    for share in [
        "covered",
        "lightness",
        "chroma_spread",
        "saturation",
        "at_ends",
        "texture",
        "thinness",
    ] {
        let value = found["difficulty"][share].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&value), "{share} {value}");
    }
    let said = bench.json("inspect in.ply --kind terrain --json", 0);
    assert_eq!(
        (&said["kind"]["found"], &said["kind"]["used"]),
        (&"object".into(), &"terrain".into())
    );
    let file = std::fs::metadata(bench.path("in.ply")).unwrap().len();
    for (field, value) in [
        ("file_bytes", file),
        ("gaussians", 500),
        ("ignored_rows", 0),
        ("sh_degree_stored", 1),
        ("sh_degree_used", 1),
        ("sh_degree_learned", 1),
    ] {
        assert_eq!(found[field], value, "{field}");
    }
    assert_eq!(
        (&found["format"], &found["colours_rounded"]),
        (&"PLY".into(), &false.into())
    );
    assert!(found["extent"]["radius"].as_f64().unwrap() > 0.0, "{found}");
    assert!(found["seen_gaussians"].is_null());
    for command in ["render", "embed"] {
        let need = &found[command];
        let parts: u64 = need["parts"]
            .as_object()
            .unwrap()
            .values()
            .map(|v| v.as_u64().unwrap())
            .sum();
        assert_eq!((need["bytes"].as_u64(), &need["fits"]), (Some(parts), &true.into()));
    }
    let seen = bench.json("inspect in.ply --views 8 --json", 0);
    assert!(
        (100..=500).contains(&seen["seen_gaussians"].as_u64().unwrap()),
        "{seen}"
    );

    // What is predicted for an embedding is what an embedding says, but for what the key adds.
    bench.exits("key create --bits 32 --seed 7 -o k.key --device cpu", 0);
    let line = "embed in.ply out.ply --key k.key --message 0123abcd --force --device cpu --json";
    write(&bench.path("one.json"), r#"{"steps": 1, "early_stop": null}"#);
    let report = bench.json(&format!("{line} --settings one.json"), 3);
    let [said, predicted] = [&report["predicted_memory"], &found["embed"]["parts"]];
    for part in ["program", "scene", "optimiser"] {
        assert_eq!(said[part], predicted[part], "{part}");
    }

    // A short trial tells what the mark would come to, and writes nothing.
    assert!(found["forecast"].is_null());
    let line = "inspect in.ply --forecast --key k.key --preset draft --device cpu --json";
    let told = &bench.json(line, 0)["forecast"];
    assert_eq!((&told["bits"], &told["preset"]), (&32.into(), &"draft".into()));
    let bits = told["bit_accuracy"].as_f64().unwrap();
    assert!(
        (0.5..1.0).contains(&bits) && told["seconds"].as_f64().unwrap() > 0.0,
        "{told}"
    );
    assert_eq!(told["meets_target"], bits >= told["wanted"].as_f64().unwrap());
    // Where it would miss, a message of 16 bits is tried.
    assert_eq!(told["shorter"].is_null(), told["meets_target"] == true);

    // Of the message that will be hidden, another forecast; one that is too long for the key is refused.
    let of_message = |message: &str| format!("{line} --message {message}");
    let other = &bench.json(&of_message("ffffffff"), 0)["forecast"];
    assert_ne!(other["reach"], told["reach"]);
    assert!(bench.fails(&of_message("ffffffff00")).contains("32 bits"));

    // With less memory, and with NaN.
    let small = bench.json("inspect in.ply --memory 60 --json", 0);
    assert_eq!(
        (&small["render"]["fits"], &small["embed"]["fits"]),
        (&true.into(), &false.into())
    );
    let text = bench.exits("inspect in.ply --memory 60", 0);
    assert!(text.contains("500") && text.contains("does not fit"), "{text}");
    let mut bytes = std::fs::read(bench.path("in.ply")).unwrap();
    let last = bytes.len() - 4;
    bytes[last..].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(bench.path("nan.ply"), bytes).unwrap();
    let found = bench.json("inspect nan.ply --ignore-bad-rows --json", 0);
    assert_eq!((&found["gaussians"], &found["ignored_rows"]), (&499.into(), &1.into()));
}
