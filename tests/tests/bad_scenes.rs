//! Scene files that are none: whatever reads them says what is wrong, and leaves nothing behind.
use guardsplat_tests::Bench;
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
    let bench = Bench::new();
    for (name, bytes, needles) in bad_scenes() {
        bench.write(name, bytes);
        bench.refuses(
            &format!("render {name} views --views 1 --size 32 --device cpu"),
            needles,
        );
    }
    bench.refuses("render none.ply views --views 1", &["none.ply", "No such file"]);
    bench.refuses("render . views --views 1", &["not a regular file"]);
}

/// The files above are bad for one reason each: without it they are read.
#[test]
fn the_same_scene_without_a_fault_is_rendered() {
    let bench = Bench::new();
    for rest in [0, 9, 24, 45, 72] {
        let name = format!("good{rest}.ply");
        bench.write(&name, Ply::new(5, rest).bytes());
        bench.exits(
            &format!("render {name} views{rest} --views 1 --size 32 --device cpu"),
            0,
        );
    }
}

/// What embedding and verification read is refused by the same rules, before a result exists.
#[test]
fn embedding_and_verifying_a_bad_scene_names_what_is_wrong() {
    let bench = Bench::new();
    bench.exits("key create --bits 8 --seed 3 -o k.key --device cpu", 0);
    bench.write("kept.ply", "an older result");
    for (name, bytes, needles) in bad_scenes() {
        bench.write(name, bytes);
        let named: Vec<&str> = if name == "empty.ply" {
            needles.to_vec()
        } else {
            needles.iter().copied().chain([name]).collect()
        };
        bench.refuses(
            &format!("embed {name} out.ply --key k.key --message 5c --device cpu --preset draft"),
            &named,
        );
        bench.refuses(
            &format!("embed {name} kept.ply --key k.key --message 5c --device cpu --preset draft"),
            &named,
        );
        bench.refuses(&format!("verify {name} --key k.key --message 5c --device cpu"), &named);
    }
}
