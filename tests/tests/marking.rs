//! `key`, `embed` and `verify` with the CLIP that the worker ships with: reports, exit codes and refusals. How well
//! a mark is read is not tested here, only that what is said about it is true.
use std::sync::LazyLock;

use guardsplat_tests::{TestEnvironment, shipped_clip};
use serde_json::Value;

/// A scene, a key of 32 bits, a hasty embedding of it, and the report on that. Made once for all tests.
struct Marked {
    files: [(&'static str, Vec<u8>); 4],
    report: Value,
}

const MESSAGE: &str = "c0ffee42";
/// Few and small views, and a target that any result reaches.
const SETTINGS: &str = r#"{"steps": 3, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null,
    "verify": {"views": 3, "message_views": 2},
    "target": {"bit_accuracy": 0, "psnr_db": 0, "message": false}}"#;
const EMBED: &str = "embed in.ply out.ply --key k.key --message c0ffee42 --settings hasty.json --size 32 --preset draft \
    --device cpu --json";

static MARKED: LazyLock<Marked> = LazyLock::new(|| {
    let environment = TestEnvironment::new();
    environment.write("hasty.json", SETTINGS);
    environment.exits("sample in.ply --gaussians 1000 --sh-degree 1 --seed 9", 0);
    let key = environment.json("key create --bits 32 --seed 5 -o k.key --device cpu --json", 0);
    assert_eq!((&key["bits"], &key["device"]), (&32.into(), &"cpu".into()));
    assert!(key["bit_accuracy_unseen"].as_f64().unwrap() > 0.85, "{key}");
    let report = environment.json(EMBED, 0);
    // Only the bytes: a folder in a static would never be removed.
    let files = ["in.ply", "k.key", "hasty.json", "out.ply"].map(|name| (name, environment.read(name)));
    Marked { files, report }
});

fn marked(name: &str) -> &[u8] {
    let file = MARKED.files.iter().find(|(other, _)| *other == name);
    &file.expect("one of the files").1
}

/// A folder with some of the files.
fn environment_with(names: &[&str]) -> TestEnvironment {
    let environment = TestEnvironment::new();
    for name in names {
        environment.write(name, marked(name));
    }
    environment
}

#[test]
fn the_report_of_an_embedding_has_every_field() {
    let report = &MARKED.report;
    let number = |field: &str| report[field].as_f64().unwrap_or_else(|| panic!("{field}: {report}"));
    let share = |field: &str| assert!((0.0..=1.0).contains(&number(field)), "{field}: {report}");
    share("bit_accuracy");
    share("bit_accuracy_worst_view");
    share("ssim");
    assert!(number("bit_accuracy_worst_view") <= number("bit_accuracy"));
    assert!(number("psnr_db") > 20.0 && report["identical"] == false, "{report}");
    assert!(number("seconds") > 0.0);
    assert_eq!((&report["steps"], &report["view_steps"]), (&3.into(), &6.into()));
    assert_eq!(
        (&report["device"], &report["clip"]),
        (&"cpu".into(), &"guardsplat-2".into())
    );
    assert_eq!(report["message"].as_str().map(str::len), Some(8));
    assert_eq!(report["message_recovered"], report["message"] == MESSAGE);
    // No weights of LPIPS were added.
    assert!(report["lpips"].is_null() && report.get("lpips").is_some(), "{report}");
    assert_eq!(report["written"], true);
}

#[test]
fn marking_changes_colours_only_and_is_reproducible() {
    let environment = environment_with(&["in.ply", "k.key", "hasty.json"]);
    environment.exits(EMBED, 0);
    assert!(environment.read("out.ply") == marked("out.ply"));
    let (before, after) = (environment.read("in.ply"), environment.read("out.ply"));
    assert_eq!(before.len(), after.len());
    // x y z and normals, then 3 + 9 colours, then opacity, scales and rotation, four bytes each.
    let row = 4 * (6 + 12 + 8);
    let header = before.len() - 1000 * row;
    assert!(before[..header] == after[..header]);
    let mut changed = 0;
    for (a, b) in before[header..].chunks(row).zip(after[header..].chunks(row)) {
        assert!(a[..24] == b[..24] && a[72..] == b[72..]);
        changed += usize::from(a != b);
    }
    assert_eq!(MARKED.report["changed_gaussians"], changed);
    assert!(changed > 100, "{changed}");
}

#[test]
fn copies_that_are_marked_together_are_those_that_are_marked_alone() {
    let environment = environment_with(&["in.ply", "k.key", "hasty.json"]);
    environment.write("messages", "C0FFEE42\n\n12345678\n");
    let embed = EMBED.replace("--message c0ffee42", "--messages messages");
    let report = environment.json(&embed.replace("out.ply", "marked"), 0);
    assert!(environment.read("marked/c0ffee42.ply") == marked("out.ply"));
    environment.exits(&EMBED.replace("c0ffee42", "12345678"), 0);
    assert!(environment.read("marked/12345678.ply") == environment.read("out.ply"));
    assert_eq!(environment.names("marked"), ["12345678.ply", "c0ffee42.ply"]);
    let copies = report["copies"].as_array().unwrap();
    let outputs: Vec<&Value> = copies.iter().map(|copy| &copy["output"]).collect();
    assert_eq!(outputs, ["marked/c0ffee42.ply", "marked/12345678.ply"]);
    assert_eq!(copies[0]["bit_accuracy"], MARKED.report["bit_accuracy"]);
    environment.write("messages", "c0ffee42\nc0ff\n");
    environment.refuses(&embed, &["--messages", "line 2", "32 bits"]);
}

#[test]
fn the_report_of_a_verification_has_every_field_and_the_exit_code_is_its_verdict() {
    let environment = environment_with(&["out.ply", "k.key"]);
    let verify = "verify out.ply --key k.key --device cpu --views 3 --size 32 --json";
    // Without a message there is nothing to decide.
    let reading = environment.json(verify, 3);
    assert_eq!(reading["verdict"], "inconclusive");
    assert!(
        reading["p_value"].is_null() && reading["reason"].is_string(),
        "{reading}"
    );
    let read = reading["message"].as_str().unwrap().to_owned();

    let report = environment.json(&format!("{verify} --message {read}"), 0);
    assert_eq!(report["verdict"], "match");
    assert_eq!((&report["matched_bits"], &report["bits"]), (&32.into(), &32.into()));
    assert_eq!(
        (&report["views"], &report["message"]),
        (&3.into(), &read.as_str().into())
    );
    for field in [
        "p_value",
        "threshold",
        "rank_sum",
        "needed_rank_sum",
        "bit_accuracy",
        "bit_accuracy_worst_view",
        "mean_abs_logit",
        "view_agreement",
        "seconds",
    ] {
        assert!(report[field].is_number(), "{field}: {report}");
    }
    assert_eq!(
        (&report["device"], &report["clip"]),
        (&"cpu".into(), &"guardsplat-2".into())
    );

    let opposite = !u32::from_str_radix(&read, 16).unwrap();
    let report = environment.json(&format!("{verify} --message {opposite:08x}"), 2);
    assert_eq!(
        (&report["verdict"], &report["matched_bits"]),
        (&"no_match".into(), &0.into())
    );
}

#[test]
fn pictures_are_read_whatever_their_format() {
    let environment = environment_with(&["out.ply", "k.key"]);
    environment.exits("render out.ply views --views 2 --size 64 --device cpu", 0);
    let picture = image::load_from_memory(&environment.read("views/view_000.png")).unwrap();
    picture.save(environment.path("views/view_002.jpg")).unwrap();
    picture.save(environment.path("views/view_003.webp")).unwrap();
    let report = environment.json("verify views --key k.key --device cpu --json", 3);
    assert_eq!(report["views"], 4);
    let one = environment.json("verify views/view_000.png --key k.key --device cpu --json", 3);
    assert_eq!(one["views"], 1);
    // WebP is lossless here: the same picture, the same reading.
    let same = environment.json("verify views/view_003.webp --key k.key --device cpu --json", 3);
    assert_eq!(same["message"], one["message"]);
    assert_eq!(same["mean_abs_logit"], one["mean_abs_logit"]);
}

#[test]
fn a_missed_target_exits_with_3_and_writes_nothing_unless_forced() {
    let environment = environment_with(&["in.ply", "k.key"]);
    environment.write("hasty.json", SETTINGS.replace("\"psnr_db\": 0", "\"psnr_db\": 200"));
    let before = environment.contents();
    let report = environment.json(EMBED, 3);
    assert_eq!(report["written"], false);
    assert!(
        report["target_missed"][0].as_str().unwrap().contains("PSNR"),
        "{report}"
    );
    assert!(environment.contents() == before);
    let report = environment.json(&format!("{EMBED} --force --report pictures"), 3);
    assert_eq!(report["written"], true);
    assert!(environment.read("out.ply") == marked("out.ply"));
    assert_eq!(environment.names("pictures"), ["comparison.png"]);
}

#[test]
fn what_does_not_fit_the_key_is_refused() {
    let environment = environment_with(&["in.ply", "k.key"]);
    environment.write("text.key", "not a key\n");
    let key = environment.read("k.key");
    environment.write("short.key", &key[..key.len() / 2]);
    environment.write("bad.png", b"\x89PNG\r\n\x1a\nbut no more");
    environment.write("text.jpg", "not a picture");
    let embed = |rest: &str| format!("embed in.ply out.ply --device cpu {rest}");
    let verify = |rest: &str| format!("verify --device cpu {rest}");
    for (line, needles) in [
        (
            embed("--key k.key --message c0ffee4200"),
            &["message", "10", "longer", "32 bits"][..],
        ),
        (embed("--key k.key --message c0ff"), &["message", "shorter", "32 bits"]),
        (
            embed("--key k.key --message c0ffee4z"),
            &["message", "character 8", "'z'"],
        ),
        (embed("--key text.key --message c0ffee42"), &["key text.key"]),
        (embed("--key short.key --message c0ffee42"), &["key short.key"]),
        (embed("--key none.key --message c0ffee42"), &["none.key"]),
        (
            embed("--key k.key --message c0ffee42 --preset best"),
            &["best", "draft, standard, robust, thorough or paper"],
        ),
        (
            embed("--key k.key --message c0ffee42 --robust-to jpeg,magic"),
            &["--robust-to", "magic", "crop, scaling"],
        ),
        (embed("--key k.key --message c0ffee42 --device cuda"), &["--device"]),
        (embed("--key k.key --message c0ffee42 --size 8"), &["size", "16"]),
        (
            embed("--key k.key --message c0ffee42 --clip other"),
            &["model other", "models add"],
        ),
        (
            "embed in.ply in.ply --device cpu --key k.key --message c0ffee42".into(),
            &["is the input"],
        ),
        (
            "embed in.ply no/out.ply --device cpu --key k.key --message c0ffee42".into(),
            &["no/out.ply"],
        ),
        (
            "key create --bits 151 -o new.key --device cpu".into(),
            &["bits", "1 to 150"],
        ),
        ("key create --bits 8 -o no/new.key --device cpu".into(), &["no/new.key"]),
        (
            verify("in.ply --key k.key --message c0ffee4200"),
            &["message", "longer", "32 bits"],
        ),
        (verify("bad.png --key k.key --message c0ffee42"), &["bad.png"]),
        (
            verify("text.jpg --key k.key --message c0ffee42"),
            &["text.jpg", "not a PNG"],
        ),
        (
            verify("k.key --key k.key --message c0ffee42"),
            &["k.key: not a PNG", "and not a scene"],
        ),
        (verify("in.ply bad.png --key k.key --message c0ffee42"), &["bad.png"]),
        (
            "verify in.ply --key k.key --message c0ffee42 --device tpu".into(),
            &["tpu", "auto, wgpu or cpu"],
        ),
    ] {
        environment.refuses(&line, needles);
    }
}

#[test]
fn a_key_belongs_to_one_clip() {
    let mut environment = environment_with(&["in.ply", "k.key"]);
    // The same CLIP but for the last bit of one of its weights.
    std::fs::create_dir(environment.path("clip")).unwrap();
    for entry in std::fs::read_dir(shipped_clip()).unwrap() {
        let path = entry.unwrap().path();
        if !path.is_file() {
            continue;
        }
        let mut bytes = std::fs::read(&path).unwrap();
        if path.extension().is_some_and(|e| e == "safetensors") {
            let last = bytes.len() - 2;
            bytes[last] ^= 1;
        }
        std::fs::write(environment.path("clip").join(path.file_name().unwrap()), bytes).unwrap();
    }
    environment.set("GUARDSPLAT_CLIP", environment.path("clip"));
    let needles = &["key k.key", "belongs to the CLIP"];
    environment.refuses("verify in.ply --key k.key --message c0ffee42 --device cpu", needles);
    environment.refuses(
        "embed in.ply out.ply --key k.key --message c0ffee42 --device cpu",
        needles,
    );
}

#[test]
#[cfg(unix)]
fn a_full_disk_is_known_before_the_work() {
    let environment = environment_with(&["in.ply", "k.key", "hasty.json"]);
    environment.write("out.ply", "an older result");
    let before = environment.contents();
    let output = environment.run_on_a_full_disk(64, EMBED);
    guardsplat_tests::environment::check_refusal(EMBED, &output, &["out.ply", "File too large"]);
    assert!(
        !String::from_utf8_lossy(&output.stderr).contains("embedding "),
        "steps were taken"
    );
    assert!(environment.contents() == before);
}

/// A room is marked for those who are in it, by the cameras that it was captured with.
#[test]
fn a_room_is_marked_for_its_viewers() {
    let environment = TestEnvironment::new();
    environment.exits("key create --bits 32 --seed 1 -o k --device cpu", 0);
    environment.exits(
        "sample room.ply --kind room --cameras room.json --gaussians 10000 --sh-degree 1 --seed 6",
        0,
    );
    let mark =
        "embed room.ply out.ply --key k --message 2601cd56 --cameras room.json --preset draft --force --device cpu";
    assert!(matches!(environment.run(mark).status.code(), Some(0 | 3)));
    // Held-out cameras, which no training view was at. From outside the same scene is another one.
    let read = "verify out.ply --key k --message 2601cd56 --device cpu --json";
    let inside = environment.json(&format!("{read} --cameras room.json"), 0);
    assert!(inside["bit_accuracy"].as_f64().unwrap() > 0.85, "{inside}");
    // Small views are read as the pictures of 800 px that they stand for.
    let large = environment.json(&format!("{read} --cameras room.json --size 800"), 0);
    let [small, large] = [&inside, &large].map(|read| read["bit_accuracy"].as_f64().unwrap());
    assert!((small - large).abs() < 0.05, "{small} {large}");
    environment.refuses(
        "embed room.ply out.ply --key k --message 2601cd56 --cameras room.json --ring 30 --device cpu",
        &["--cameras", "--ring"],
    );
    environment.refuses("sample object.ply --cameras object.json", &["--cameras", "--kind room"]);
}
