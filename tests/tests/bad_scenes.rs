//! Scene files that are none: whatever reads them says what is wrong, and leaves nothing behind.
use guardsplat_tests::TestEnvironment;
use guardsplat_tests::ply::Ply;

/// Every kind of bad file, with what the message must name.
fn bad_scenes() -> Vec<(&'static str, Vec<u8>, &'static [&'static str])> {
    let whole = Ply::new(5, 9);
    let mut truncated = whole.bytes();
    truncated.truncate(truncated.len() - 30);
    let mut no_properties = Ply::new(5, 0).promise("400000000");
    no_properties.properties.clear();
    let mut no_opacity = whole.clone();
    no_opacity.properties[6] = "alpha".into();
    vec![
        (
            "text.ply",
            b"Dear diary,\ntoday I was no scene.\n".to_vec(),
            &["neither a PLY", "a .splat"],
        ),
        ("nothing.ply", Vec::new(), &["it is empty"]),
        (
            "endless.ply",
            [b"ply\n".to_vec(), vec![b'c'; 100_000]].concat(),
            &["end_header", "65536"],
        ),
        ("truncated.ply", truncated, &["truncated body", "4 of the 5"]),
        (
            "huge.ply",
            whole.clone().promise(&format!("1{}", "0".repeat(23))).bytes(),
            &["element vertex", "100000000000000000000000", "limit"],
        ),
        (
            "many.ply",
            whole.clone().promise("400000000").bytes(),
            &["truncated body", "5 of the 400000000"],
        ),
        (
            "no_properties.ply",
            no_properties.bytes(),
            &["element vertex has no property x"],
        ),
        ("no_opacity.ply", no_opacity.bytes(), &["no property opacity"]),
        (
            "rest.ply",
            Ply::new(5, 10).bytes(),
            &["10 f_rest", "0, 9, 24, 45 or 72"],
        ),
        (
            "nan.ply",
            whole.clone().set(3, "y", f32::NAN).bytes(),
            &["property y", "row 3", "NaN"],
        ),
        (
            "infinite.ply",
            whole.clone().set(2, "f_rest_7", f32::INFINITY).bytes(),
            &["property f_rest_7", "row 2", "inf"],
        ),
        ("empty.ply", Ply::new(0, 9).bytes(), &["no Gaussians"]),
    ]
}

#[test]
fn rendering_a_bad_scene_names_what_is_wrong() {
    let environment = TestEnvironment::new();
    for (name, bytes, needles) in bad_scenes() {
        environment.write(name, bytes);
        environment.refuses(
            &format!("render {name} views --views 1 --size 32 --device cpu"),
            needles,
        );
    }
    environment.refuses("render none.ply views --views 1", &["none.ply", "No such file"]);
    let reason = "a folder without the files of a SOG: meta.json and means_l.webp, or lod-meta.json";
    environment.refuses("render . views --views 1", &[reason]);
}

/// The files above are bad for one reason each: without it they are read.
#[test]
fn the_same_scene_without_a_fault_is_rendered() {
    let environment = TestEnvironment::new();
    for rest in [0, 9, 24, 45, 72] {
        let name = format!("good{rest}.ply");
        environment.write(&name, Ply::new(5, rest).bytes());
        environment.exits(
            &format!("render {name} views{rest} --views 1 --size 32 --device cpu"),
            0,
        );
    }
}

/// What embedding and verification read is refused by the same rules, before a result exists.
#[test]
fn embedding_and_verifying_a_bad_scene_names_what_is_wrong() {
    let environment = TestEnvironment::new();
    environment.exits("key create --bits 8 --seed 3 -o k.key --device cpu", 0);
    environment.write("kept.ply", "an older result");
    for (name, bytes, needles) in bad_scenes() {
        environment.write(name, bytes);
        let named: Vec<&str> = if name == "empty.ply" {
            needles.to_vec()
        } else {
            needles.iter().copied().chain([name]).collect()
        };
        environment.refuses(
            &format!("embed {name} out.ply --key k.key --message 5c --device cpu --preset draft"),
            &named,
        );
        environment.refuses(
            &format!("embed {name} kept.ply --key k.key --message 5c --device cpu --preset draft"),
            &named,
        );
        environment.refuses(&format!("verify {name} --key k.key --message 5c --device cpu"), &named);
    }
}

/// A scene with two bad rows among others, and where they are.
fn with_bad_rows() -> (Ply, [usize; 2]) {
    let scene = Ply::new(40, 9)
        .set(3, "y", f32::NAN)
        .set(3, "rot_2", f32::INFINITY)
        .set(17, "f_rest_7", f32::NAN);
    (scene, [3, 17])
}

const TOLD: &str = "2 rows ignored, the first since property y of row 3 is NaN";

#[test]
fn bad_rows_are_left_out_of_pictures_when_that_is_asked_for() {
    let environment = TestEnvironment::new();
    let (scene, bad) = with_bad_rows();
    environment.write("nan.ply", scene.bytes());
    let line = |name: &str| format!("render {name}.ply {name} --views 2 --size 32 --device cpu");
    environment.refuses(&line("nan"), &["nan.ply", "property y of row 3 is NaN"]);
    let told = environment.exits(&(line("nan") + " --ignore-bad-rows"), 0);
    assert!(told.ends_with(&format!("{TOLD}\n")), "{told}");

    let mut without = scene.clone();
    without.rows = (0..40)
        .filter(|row| !bad.contains(row))
        .map(|row| scene.rows[row].clone())
        .collect();
    environment.write("good.ply", without.promise("38").bytes());
    let told = environment.exits(&(line("good") + " --ignore-bad-rows"), 0);
    assert!(!told.contains("ignored"), "{told}");
    for name in ["view_000.png", "view_001.png", "cameras.json"] {
        let [nan, good] = ["nan", "good"].map(|folder| environment.read(&format!("{folder}/{name}")));
        assert!(nan == good, "{name}");
    }

    let hopeless = (0..5).fold(Ply::new(5, 0), |scene, row| scene.set(row, "x", f32::NAN));
    environment.write("none.ply", hopeless.bytes());
    let words = "none of 5 rows is left, the first since property x of row 0 is NaN";
    environment.refuses(&(line("none") + " --ignore-bad-rows"), &["none.ply", words]);
}

#[test]
fn bad_rows_are_written_as_they_were() {
    let environment = TestEnvironment::new();
    environment.exits("key create --bits 8 --seed 3 -o k.key --device cpu", 0);
    let (scene, bad) = with_bad_rows();
    environment.write("in.ply", scene.bytes());
    environment.write(
        "hasty.json",
        r#"{"steps": 3, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null,
            "verify": {"views": 3, "message_views": 2}, "target": {"bit_accuracy": 0, "psnr_db": 0, "message": false}}"#,
    );
    let embed =
        "embed in.ply out.ply --key k.key --message 5c --settings hasty.json --size 32 --preset draft --device cpu";
    let reason = "property y of row 3 is NaN";
    environment.refuses(embed, &["in.ply", reason]);
    let report = environment.json(&format!("{embed} --ignore-bad-rows --json"), 0);
    assert_eq!((&report["ignored_rows"], &report["gaussians"]), (&2.into(), &38.into()));
    let changed = report["changed_gaussians"].as_u64().unwrap();
    assert!(changed > 0, "{report}");

    // Colours of good rows may differ, and nothing else: NaN by its bytes.
    let (before, after) = (scene.bytes(), environment.read("out.ply"));
    assert_eq!(before.len(), after.len());
    let row = 4 * scene.properties.len();
    let header = before.len() - 40 * row;
    assert_eq!(before[..header], after[..header]);
    let mut rows = before[header..]
        .chunks(row)
        .zip(after[header..].chunks(row))
        .enumerate();
    let differ = rows.by_ref().filter(|(i, (before, after))| {
        let colours = 12..24;
        assert_eq!(before[..colours.start], after[..colours.start], "row {i}");
        assert_eq!(before[colours.end..], after[colours.end..], "row {i}");
        assert!(!bad.contains(i) || before == after, "row {i}");
        before != after
    });
    assert_eq!(differ.count() as u64, changed);

    environment.refuses(
        "verify out.ply --key k.key --message 5c --device cpu",
        &["out.ply", reason],
    );
    let verify = "verify out.ply --key k.key --message 5c --views 2 --device cpu --ignore-bad-rows";
    // So few steps mark nothing.
    assert_eq!(environment.json(&format!("{verify} --json"), 2)["ignored_rows"], 2);
    assert!(environment.exits(verify, 2).contains(TOLD));
}
