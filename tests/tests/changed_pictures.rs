//! Pictures of a marked scene that people changed, read by `verify`.
use std::sync::LazyLock;

use guardsplat_tests::TestEnvironment;
use guardsplat_tests::backdrops::{busy, filtered, over};
use serde_json::Value;

const VERIFY: &str = "verify views --key k.key --message c0ff --device cpu --json";

/// A scene, a key of 16 bits, and a mark. Made once for all tests.
static MARKED: LazyLock<[(&str, Vec<u8>); 3]> = LazyLock::new(|| {
    let environment = TestEnvironment::new();
    environment.exits("sample in.ply --gaussians 5000 --sh-degree 1 --seed 4", 0);
    environment.exits("key create --bits 16 --seed 5 -o k.key --device cpu", 0);
    environment.exits(
        "embed in.ply out.ply --key k.key --message c0ff --preset draft --device cpu --force",
        0,
    );
    // Only the bytes: a folder in a static would never be removed.
    ["in.ply", "k.key", "out.ply"].map(|name| (name, environment.read(name)))
});

fn marked() -> TestEnvironment {
    let environment = TestEnvironment::new();
    for (name, bytes) in MARKED.iter() {
        environment.write(name, bytes);
    }
    environment
}

/// A view in a folder.
fn picture(environment: &TestEnvironment, folder: &str, view: usize) -> image::RgbImage {
    let bytes = environment.read(&format!("{folder}/view_00{view}.png"));
    image::load_from_memory(&bytes).unwrap().to_rgb8()
}

/// A picture with noise of a twentieth, a twentieth brighter, and a grey square on it.
fn changed(picture: &image::RgbImage) -> image::RgbImage {
    let mut state = 7_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // Uniform, with a standard deviation of 13 of 255 levels.
        ((state >> 8) as f32 / 16_777_216.0 - 0.5) * 44.0
    };
    let mut changed = picture.clone();
    for (x, y, pixel) in changed.enumerate_pixels_mut() {
        let covered = x < 60 && (40..100).contains(&y);
        for value in &mut pixel.0 {
            let shown = if covered { 120.0 } else { f32::from(*value) * 1.05 };
            *value = (shown + noise()).round().clamp(0.0, 255.0) as u8;
        }
    }
    changed
}

#[test]
fn short_messages_match_in_changed_pictures_also_where_nobody_says_which() {
    let environment = marked();
    environment.exits("render out.ply views --views 3 --size 400 --device cpu", 0);
    let as_given = environment.json(VERIFY, 0);
    assert_eq!(as_given["clip"], "guardsplat-2");
    // The message is in a word of 64 bits.
    assert_eq!((&as_given["bits"], &as_given["framing"]), (&64.into(), &Value::Null));
    for view in 0..3 {
        let picture = changed(&picture(&environment, "views", view));
        picture
            .save(environment.path(format!("views/view_00{view}.png")))
            .unwrap();
    }
    let read = environment.json(VERIFY, 0);
    assert_eq!((&read["verdict"], &read["message"]), (&"match".into(), &"c0ff".into()));
    assert_eq!(read["bit_accuracy"], 1.0, "{read}");
    // Whoever does not know the message reads it, and pays for all that it could have been.
    let blind = environment.json("verify views --key k.key --device cpu --json", 0);
    assert_eq!(
        (&blind["verdict"], &blind["message"]),
        (&"match".into(), &"c0ff".into())
    );
    assert!(blind["p_value"].as_f64() > read["p_value"].as_f64(), "{blind}");
    environment.json("verify views --key k.key --message c0fe --device cpu --json", 2);
    environment.json("verify in.ply --key k.key --device cpu --json", 2);
    // Bit by bit sixteen are too few for a match.
    environment.exits("key create --bits 16 --seed 5 --uncoded -o bits.key --device cpu", 0);
    let short = environment.json("verify views --key bits.key --message c0ff --device cpu --json", 3);
    assert_eq!(short["bits"], 16);
}

/// Three views over white and over black, in folders of these names, and an empty folder of views.
fn over_white_and_black(environment: &TestEnvironment) {
    for ground in ["white", "black"] {
        environment.exits(
            &format!("render out.ply {ground} --views 3 --size 400 --background {ground} --device cpu"),
            0,
        );
    }
    std::fs::create_dir(environment.path("views")).unwrap();
}

/// A view over a backdrop, put into the folder of views.
fn show(environment: &TestEnvironment, view: usize, backdrop: impl Fn(f32, f32) -> [f32; 3]) {
    let [white, black] = ["white", "black"].map(|ground| picture(environment, ground, view));
    let picture = over(backdrop, &white, &black);
    picture.save(environment.path(format!("views/{view}.png"))).unwrap();
}

#[test]
fn a_photograph_behind_several_pictures_is_none_of_the_scene() {
    let environment = marked();
    over_white_and_black(&environment);
    // Gradients in one of four dark colours, by squares: such a background has large logits of its own.
    let photograph = |x: f32, y: f32| {
        let square = ((9.0 * x) as usize + 3 * (7.0 * y) as usize) % 4;
        let colour = [[0.35, 0.2, 0.1], [0.1, 0.3, 0.15], [0.25, 0.3, 0.4], [0.15, 0.1, 0.2]][square];
        std::array::from_fn(|c| colour[c] + 0.05 * x * y + 0.02 * (40.0 * x).sin())
    };
    // The scene covers little of it: a quarter of the picture shows a view.
    let show = |view: usize, moved: f32| {
        let behind = |x: f32, y: f32| photograph(x + moved, y - moved);
        show(&environment, view, |x, y| behind((x + 0.2) / 2.0, (y + 0.3) / 2.0));
        let mut whole = image::RgbImage::from_fn(800, 800, |x, y| {
            image::Rgb(behind(x as f32 / 800.0, y as f32 / 800.0).map(|v| (255.0 * v).round() as u8))
        });
        let path = environment.path(format!("views/{view}.png"));
        let part = image::open(&path).unwrap().to_rgb8();
        image::imageops::replace(&mut whole, &part, 80, 120);
        whole.save(path).unwrap();
    };
    (0..3).for_each(|view| show(view, 0.3 * view as f32));
    environment.json(VERIFY, 2);
    (0..3).for_each(|view| show(view, 0.0));
    let read = environment.json(VERIFY, 0);
    let told = read["estimates"].to_string();
    assert!(told.contains("without what other pictures show, too"), "{read}");
}

#[test]
fn a_mark_is_read_over_the_gradients_that_viewers_have_behind_a_scene() {
    let environment = marked();
    over_white_and_black(&environment);
    let backdrops: [&dyn Fn(f32, f32) -> [f32; 3]; 3] = [
        &|x, y| [0.45 - 0.3 * (x - 0.5).hypot(y - 0.5); 3],
        &|_, y| [0.3 + 0.3 * y, 0.4 + 0.3 * y, 0.6 + 0.3 * y],
        &|x, y| [0.5 + 0.3 * x + 0.1 * y, 0.6 + 0.2 * x + 0.15 * y, 0.8 + 0.1 * x],
    ];
    for (place, backdrop) in backdrops.into_iter().enumerate() {
        for at in 0..3 {
            show(&environment, at, backdrop);
        }
        let read = environment.json(VERIFY, 0);
        assert_eq!(read["verdict"], "match", "{place}: {read}");
        // Bright ones may be white in uneven light as well.
        let told = read["estimates"].to_string();
        assert!(place == 0 || told.contains("without its backdrop"), "{told}");
    }
}

#[test]
fn one_picture_over_anything_and_with_a_filter_is_compared_with_the_original() {
    let environment = marked();
    over_white_and_black(&environment);
    show(&environment, 1, busy);
    let path = environment.path("views/1.png");
    filtered(image::open(&path).unwrap().to_rgb8()).save(&path).unwrap();
    let blind = environment.json(VERIFY, 2);
    assert_eq!(blind["explained_by_original"], Value::Null, "{blind}");
    let found = environment.json(&format!("{VERIFY} --original in.ply"), 0);
    assert_eq!(
        found["framing"], "compared with the original, tones fitted to it",
        "{found}"
    );
    assert!(found["explained_by_original"][0].as_f64() > Some(0.9), "{found}");
    // The original says nothing of another message, and nothing at all of a scene that the picture does not show.
    environment.json(
        "verify views --key k.key --message c0fe --device cpu --json --original in.ply",
        2,
    );
    environment.exits("sample other.ply --gaussians 5000 --sh-degree 1 --seed 77", 0);
    let other = environment.json(&format!("{VERIFY} --original other.ply"), 2);
    assert_eq!(other["explained_by_original"], serde_json::json!([null]), "{other}");
    // The marked scene is none: it has the message whatever is compared with it.
    environment.refuses(
        &format!("{VERIFY} --original out.ply"),
        &["out.ply carries the message"],
    );
    // One that is not there is told, whether it is needed or not.
    let missing = "verify white --key k.key --message c0ff --device cpu --json --original nothing.ply";
    environment.exits(missing, 1);
    // Pictures of what is not marked show the scene, and have no message.
    environment.exits("render in.ply unmarked --views 2 --size 400 --device cpu", 0);
    let unmarked = environment.json(
        "verify unmarked --key k.key --message c0ff --device cpu --json --original in.ply",
        2,
    );
    assert_eq!(unmarked["explained_by_original"].as_array().map(Vec::len), Some(2));
}
