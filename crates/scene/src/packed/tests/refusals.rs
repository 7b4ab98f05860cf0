//! Every kind of bad file has its message.
use super::*;
use crate::BadRows;

#[test]
fn other_encodings_are_refused() {
    for format in ["ascii", "binary_big_endian"] {
        let mut file = File::new(2, 0);
        file.format = format;
        assert_eq!(
            file.refused(),
            "a compressed PLY (property packed_position) must be binary_little_endian"
        );
    }
}

#[test]
fn wrong_properties_are_named() {
    let broken = |change: &dyn Fn(&mut File)| {
        let mut file = File::new(300, 9);
        change(&mut file);
        file.refused()
    };
    let missing = |element: &str, name: &str| format!("a compressed PLY, but element {element} has no property {name}");
    for name in [GEOMETRY[0], GEOMETRY[11], COLOUR[0], COLOUR[5]] {
        assert_eq!(broken(&|file| file.chunk().remove(name)), missing("chunk", name));
    }
    for name in &WORDS[1..] {
        assert_eq!(broken(&|file| file.vertex().remove(name)), missing("vertex", name));
    }
    // Without this property it is a plain PLY.
    assert!(broken(&|file| file.vertex().remove("packed_position")).contains("no property x"));
    assert_eq!(
        broken(&|file| file.chunk().columns[3].0 = "double"),
        "property max_x of element chunk is Double, must be Float"
    );
    assert_eq!(
        broken(&|file| file.vertex().columns[2].0 = "int"),
        "property packed_scale of element vertex is Int, must be UInt"
    );
    assert_eq!(
        broken(&|file| file.sh().columns[2].0 = "float"),
        "property f_rest_2 of element sh is Float, must be UChar"
    );
    assert!(broken(&|file| file.sh().remove("f_rest_8")).starts_with("8 f_rest properties fit no degree"));
    assert_eq!(
        broken(&|file| file.sh().columns[2].1 = "f_rest_9".into()),
        missing("sh", "f_rest_2")
    );
    assert_eq!(
        broken(&|file| _ = file.elements.remove(0)),
        "a compressed PLY, but the header has no element chunk"
    );
    let list = File::new(1, 9)
        .header()
        .replace("uint packed_color", "list uchar uint packed_color");
    assert!(refused(list.as_bytes()).contains("property packed_color of element vertex is a list"));
    let mut before = File::new(1, 0);
    before
        .elements
        .insert(0, Element::new("nothing", "float", &[], Vec::new()));
    before.elements[0].promised = Some("5".into());
    assert!(
        before.refused().contains("element nothing before chunk"),
        "{}",
        before.refused()
    );
}

#[test]
fn counts_that_do_not_fit_are_refused_before_anything_is_allocated() {
    let promise = |element: &str, count: &str| {
        let mut file = File::new(300, 9);
        file.element(element).promised = Some(count.into());
        file.refused()
    };
    assert_eq!(
        promise("chunk", "1"),
        "element chunk has 1 rows of 256 Gaussians each; the 300 of element vertex need 2"
    );
    assert_eq!(promise("sh", "301"), "element sh has 301 rows, element vertex 300");
    // The bytes of the other elements are taken for rows.
    assert!(promise("chunk", "400000000000").contains("of the 400000000000 rows of element chunk"));
    let many = usize::MAX.to_string();
    assert!(
        promise("chunk", &many).contains("too many rows"),
        "{}",
        promise("chunk", &many)
    );
    assert!(promise("vertex", &many).contains("element chunk has 2 rows"));
    let mut file = File::new(300, 0);
    file.chunk().promised = Some("8000000".into());
    file.vertex().promised = Some("2000000000".into());
    assert!(
        file.refused().contains("of the 8000000 rows of element chunk"),
        "{}",
        file.refused()
    );
    file.elements.swap(0, 1);
    assert!(file.refused().contains("rows of element chunk"), "{}", file.refused());
    file.vertex().promised = Some(many);
    assert!(file.refused().contains("too many rows"), "{}", file.refused());
}

#[test]
fn truncated_files_are_refused_at_every_length() {
    let bytes = File::new(3, 9).bytes();
    for length in 0..bytes.len() {
        refused(&bytes[..length]);
    }
    read(&bytes).unwrap();
    assert_eq!(
        refused(&bytes[..bytes.len() - 1]),
        "truncated body: 2 of the 3 rows of element sh that the header promises are there"
    );
    let vertex = bytes.len() - 3 * 9;
    assert_eq!(
        refused(&bytes[..vertex - 17]),
        "truncated body: 1 of the 3 rows of element vertex that the header promises are there"
    );
}

#[test]
fn ranges_that_cannot_be_are_named() {
    for name in [GEOMETRY[1], GEOMETRY[9], COLOUR[2], COLOUR[3]] {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut file = File::new(300, 0);
            file.chunk().set(name, 1, value);
            let reason = format!("property {name} of chunk 1 is {}", value as f32);
            assert_eq!(file.refused(), reason);
            // A chunk's ranges are no row's: nothing says which of its Gaussians would be right without them.
            let ignoring = Scene::parse_with(Path::new("it"), &file.bytes(), BadRows::Ignore);
            assert!(ignoring.unwrap_err().to_string().ends_with(&reason));
        }
    }
    let mut file = File::new(300, 0);
    file.chunk().set("max_g", 1, -1e31);
    assert_eq!(
        file.refused(),
        "property max_g of chunk 1 is -1e31, beyond the limit of 1e30"
    );
    // Largest legal ones.
    let mut file = File::new(300, 0);
    file.chunk().set("max_g", 1, -1e30);
    file.chunk().set("min_x", 1, f64::from(f32::MIN));
    file.chunk().set("max_x", 1, f64::from(f32::MAX));
    file.read().unwrap();
}

#[test]
fn chunks_without_gaussians_may_hold_anything() {
    let mut file = File::new(1, 0);
    file.chunk().rows.push(vec![f64::NAN; 18]);
    let scene = file.read().unwrap();
    assert!(written(&scene, &scene.gaussians.sh) == file.bytes());
    let mut sh = scene.gaussians.sh.clone();
    sh.coefficients[0] = 0.0;
    let out = written(&scene, &sh);
    let start = file.header().len();
    assert_eq!(out[start + 72..start + 144], file.bytes()[start + 72..start + 144]);
}

#[test]
fn an_empty_scene_is_read() {
    for rest in [0, 9] {
        let file = File::new(0, rest);
        let scene = file.read().unwrap();
        assert!(scene.gaussians.is_empty());
        assert!(written(&scene, &scene.gaussians.sh) == file.bytes());
    }
}
