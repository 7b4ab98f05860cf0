//! `sample` and `render`: what they write, and that they write the same again.
use guardsplat_tests::{TestEnvironment, real_scene};

fn size_of(bytes: &[u8]) -> (u32, u32) {
    let picture = image::load_from_memory(bytes).unwrap();
    (picture.width(), picture.height())
}

#[test]
fn samples_are_reproducible_and_as_asked_for() {
    let environment = TestEnvironment::new();
    for (name, seed) in [("a.ply", 4), ("b.ply", 4), ("c.ply", 5)] {
        environment.exits(&format!("sample {name} --gaussians 700 --sh-degree 2 --seed {seed}"), 0);
    }
    assert!(environment.read("a.ply") == environment.read("b.ply"));
    assert!(environment.read("a.ply") != environment.read("c.ply"));
    let scene = environment.read("a.ply");
    let end = b"end_header\n";
    let at = scene.windows(end.len()).position(|w| w == end).unwrap();
    let header = std::str::from_utf8(&scene[..at]).unwrap();
    assert!(header.contains("element vertex 700\n"), "{header}");
    assert_eq!(header.matches("f_rest_").count(), 24);
    let row = 4 * header.matches("property float").count();
    assert_eq!(scene.len(), at + end.len() + 700 * row);
}

#[test]
fn views_come_with_their_cameras_and_are_reproducible() {
    let environment = TestEnvironment::new();
    environment.exits("sample s.ply --gaussians 2000 --seed 1", 0);
    for (folder, seed) in [("a", 2), ("b", 2), ("c", 3)] {
        environment.exits(
            &format!("render s.ply {folder} --views 3 --size 48 --seed {seed} --device cpu"),
            0,
        );
    }
    let names = ["cameras.json", "view_000.png", "view_001.png", "view_002.png"];
    assert_eq!(environment.names("a"), names);
    for name in names {
        assert!(
            environment.read(&format!("a/{name}")) == environment.read(&format!("b/{name}")),
            "{name}"
        );
        assert!(
            environment.read(&format!("a/{name}")) != environment.read(&format!("c/{name}")),
            "{name}"
        );
    }
    let picture = environment.read("a/view_000.png");
    assert_eq!(size_of(&picture), (48, 48));
    // Something is seen, and not everywhere: white is the background.
    let pixels = image::load_from_memory(&picture).unwrap().to_rgb8();
    let white = pixels.pixels().filter(|p| p.0 == [255; 3]).count();
    assert!((100..48 * 48 - 100).contains(&white), "{white} white pixels");

    let cameras: serde_json::Value = serde_json::from_slice(&environment.read("a/cameras.json")).unwrap();
    assert_eq!(cameras.as_array().unwrap().len(), 3);
    for field in ["position", "rotation", "width", "height", "fx", "fy"] {
        assert!(!cameras[0][field].is_null(), "{field}: {cameras}");
    }
}

#[test]
fn cameras_from_a_file_see_the_same() {
    let environment = TestEnvironment::new();
    environment.exits("sample s.ply --gaussians 2000 --seed 1", 0);
    environment.exits("render s.ply a --views 3 --size 48 --device cpu", 0);
    environment.exits("render s.ply b --cameras a/cameras.json --device cpu", 0);
    assert_eq!(environment.names("b"), environment.names("a"));
    for view in 0..3 {
        let [a, b] = ["a", "b"].map(|folder| {
            let bytes = environment.read(&format!("{folder}/view_{view:03}.png"));
            image::load_from_memory(&bytes).unwrap().to_rgb8().into_raw()
        });
        // Poses are inverted twice on the way, so a value may fall to the other side of a rounding.
        let worst = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(worst <= Some(2), "view {view}: {worst:?}");
    }
    environment.exits(
        "render s.ply few --cameras a/cameras.json --views 1 --size 24 --format exr --background black --device cpu",
        0,
    );
    assert_eq!(environment.names("few"), ["cameras.json", "view_000.exr"]);

    // NeRF's transforms.json: the camera's axes are OpenGL's, sizes are in the file.
    environment.write(
        "transforms.json",
        r#"{"camera_angle_x": 0.8, "w": 40, "h": 30, "frames": [{"file_path": "x",
            "transform_matrix": [[1,0,0,0],[0,-1,0,0],[0,0,-1,-6],[0,0,0,1]]}]}"#,
    );
    environment.exits("render s.ply nerf --cameras transforms.json --device cpu", 0);
    assert_eq!(size_of(&environment.read("nerf/view_000.png")), (40, 30));
}

#[test]
fn real_scenes_are_rendered() {
    for (name, degree) in [("pod.ply", 3), ("donut.ply", 0)] {
        let Some(scene) = real_scene(name) else { return };
        let environment = TestEnvironment::new();
        let scene = scene.display();
        environment.exits(&format!("render {scene} views --views 2 --size 96 --device cpu"), 0);
        assert_eq!(environment.names("views").len(), 3, "{name} of degree {degree}");
        for view in ["views/view_000.png", "views/view_001.png"] {
            let pixels = image::load_from_memory(&environment.read(view)).unwrap().to_rgb8();
            let seen = pixels.pixels().filter(|p| p.0 != [255; 3]).count();
            assert!(seen > 96 * 96 / 10, "{name}: {seen} pixels of {view} show anything");
        }
    }
}

#[test]
fn options_and_camera_files_that_make_no_sense_are_refused() {
    let environment = TestEnvironment::new();
    environment.exits("sample s.ply --gaussians 50 --sh-degree 0", 0);
    environment.write("text.json", "no cameras\n");
    environment.write("none.json", "[]");
    environment.write(
        "flat.json",
        r#"[{"id": 0, "img_name": "a", "width": 0, "height": 9, "position": [0,0,0],
            "rotation": [[1,0,0],[0,1,0],[0,0,1]], "fx": 9, "fy": 9}]"#,
    );
    for (line, needles) in [
        ("render s.ply v --device cpu", &["--views"][..]),
        ("render s.ply v --views 0", &["--views", "1..=100000"]),
        ("render s.ply v --views 1 --size 9000", &["--size", "8192"]),
        ("render s.ply v --views 1 --background red", &["white", "black"]),
        ("render s.ply v --views 1 --device gpu", &["gpu", "auto, wgpu or cpu"]),
        (
            "render s.ply v --cameras text.json --device cpu",
            &["text.json", "not JSON"],
        ),
        (
            "render s.ply v --cameras none.json --device cpu",
            &["none.json", "no cameras"],
        ),
        (
            "render s.ply v --cameras flat.json --device cpu",
            &["flat.json", "camera 0", "width"],
        ),
        ("sample t.ply --gaussians 0", &["--gaussians", "between 1 and"]),
        ("sample t.ply --gaussians many", &["--gaussians"]),
        ("sample t.ply --sh-degree 5", &["--sh-degree", "4"]),
        ("sample no/t.ply", &["no/t.ply"]),
    ] {
        environment.refuses(line, needles);
    }
}

#[test]
#[cfg(unix)]
fn a_full_disk_leaves_the_older_file_as_it_was() {
    let environment = TestEnvironment::new();
    environment.write("s.ply", "an older scene");
    let before = environment.contents();
    let line = "sample s.ply --gaussians 2000";
    let output = environment.run_on_a_full_disk(64, line);
    guardsplat_tests::environment::check_refusal(line, &output, &["s.ply", "File too large"]);
    assert!(environment.contents() == before);
    // It is the limit that made it fail.
    environment.exits(line, 0);
}
