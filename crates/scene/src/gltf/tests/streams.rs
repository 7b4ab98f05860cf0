//! Splats as an SPZ in a buffer view: read where their node puts them, written with what follows moved.
use super::*;

/// A file with an SPZ between two blocks of bytes, under a node that turns, and the place of the second block.
fn file(spz: &[u8], name: &str, node: &str) -> (Vec<u8>, usize) {
    let mut buffer = b"before, 16 bytes".to_vec();
    buffer.extend(spz);
    buffer.resize(buffer.len().next_multiple_of(8), 0);
    let after = buffer.len();
    buffer.extend(b"after it");
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0{node}}}],
"meshes":[{{"primitives":[{{"mode":0,"attributes":{{"POSITION":0}},"extensions":{{"KHR_gaussian_splatting":{{"kernel":"ellipse",
"colorSpace":"srgb_rec709_display","extensions":{{{name:?}:{{"bufferView":1}}}}}}}}}}]}}],
"accessors":[{{"componentType":5126,"count":30,"type":"VEC3"}}],
"bufferViews":[{{"buffer":0,"byteLength":16}},{{"buffer":0,"byteOffset":16,"byteLength":{}}},{{"byteLength":8,"byteOffset":{after},"buffer":0}}],
"buffers":[{{"byteLength":{}}}]}}"#,
        spz.len(),
        buffer.len()
    );
    (glb(&text, &buffer), after)
}

fn spz(degree: usize) -> (Vec<u8>, Scene) {
    let mut bytes = Vec::new();
    crate::convert::convert(&random(30, degree, 73), Format::Spz, Path::new("it"), &mut bytes).unwrap();
    let scene = Scene::parse(Path::new("it"), &bytes).unwrap();
    (bytes, scene)
}

const NAMES: [&str; 2] = [
    "KHR_gaussian_splatting_compression_spz",
    "KHR_gaussian_splatting_compression_spz_2",
];
const TURNED: &str = r#","rotation":[0.5,0.5,0.5,0.5],"scale":[3,3,3],"translation":[0,1,0]"#;

#[test]
fn a_stream_is_the_scene_that_it_is_as_a_file() {
    for (degree, name) in [(0, NAMES[0]), (3, NAMES[1])] {
        let (bytes, alone) = spz(degree);
        let (file, _) = file(&bytes, name, "");
        let scene = read(&file).unwrap();
        assert_eq!(scene.gaussians, alone.gaussians);
        assert_eq!((scene.format(), scene.exact()), (Format::Glb, false));
        assert_eq!(
            written(&scene, &scene.gaussians.sh),
            file,
            "with its own colours it is the same file"
        );
        let sh = changed(&scene);
        assert_eq!(kept(&scene, &sh), kept(&alone, &sh), "steps are those of SPZ");
    }
}

#[test]
fn what_follows_a_longer_stream_moves() {
    for node in ["", TURNED] {
        let (bytes, _) = spz(2);
        let (old, after) = file(&bytes, NAMES[1], node);
        let scene = read(&old).unwrap();
        let sh = changed(&scene);
        let new = written(&scene, &sh);
        let again = read(&new).unwrap();
        assert_eq!(again.gaussians.sh, kept(&scene, &sh), "{node}");
        assert_eq!(again.gaussians.positions, scene.gaussians.positions);
        // Found by what the JSON says.
        let start = buffer_start(&new);
        let text = std::str::from_utf8(&new[20..start - 8]).unwrap();
        let json: serde_json::Value = serde_json::from_str(text).unwrap();
        let view = |i: usize, key: &str| json["bufferViews"][i][key].as_u64().unwrap() as usize;
        let (moved, length) = (
            view(2, "byteOffset"),
            json["buffers"][0]["byteLength"].as_u64().unwrap() as usize,
        );
        assert!(moved != after && moved % 8 == 0, "{moved}");
        assert_eq!(&new[start + moved..start + moved + 8], b"after it");
        assert_eq!(&new[start..start + 16], b"before, 16 bytes");
        assert_eq!(length, moved + 8);
        assert!(view(1, "byteLength") > bytes.len(), "noise packs badly");
        assert!(new.ends_with(b"\x04\0\0\0XTRAextrbehind"));
        let said = u32::from_le_bytes(new[8..12].try_into().unwrap()) as usize;
        assert_eq!(said, new.len() - 6);
        // The rest of the JSON is as it was, word by word.
        let words = |bytes: &[u8]| {
            let text = String::from_utf8(bytes[20..buffer_start(bytes) - 8].to_vec()).unwrap();
            text.trim_end()
                .split(|c: char| c.is_ascii_digit())
                .filter(|w| !w.is_empty())
                .map(String::from)
                .collect::<Vec<_>>()
        };
        assert_eq!(words(&new), words(&old));
    }
}

#[test]
fn a_stream_under_a_turned_node_is_turned() {
    let (bytes, alone) = spz(1);
    let (file, _) = file(&bytes, NAMES[0], TURNED);
    let scene = read(&file).unwrap();
    assert_eq!(written(&scene, &scene.gaussians.sh), file);
    // A third of a turn about the diagonal: x goes to y, y to z, z to x.
    for row in 0..30 {
        let [x, y, z] = alone.gaussians.positions[row];
        let found = scene.gaussians.positions[row];
        let near = |a: f32, b: f32| (a - b).abs() < 1e-4 * b.abs().max(1.0);
        assert!(near(found[0], 3.0 * z) && near(found[1], 3.0 * x + 1.0) && near(found[2], 3.0 * y));
        // Coefficients are -y, z and -x.
        let (old, new) = (
            &alone.gaussians.sh.coefficients[row * 12..],
            &scene.gaussians.sh.coefficients[row * 12..],
        );
        for channel in 0..3 {
            let at = |c: &[f32], i: usize| c[3 * i + channel];
            assert!(near(at(new, 1), at(old, 3)) && near(at(new, 2), -at(old, 1)) && near(at(new, 3), -at(old, 2)));
        }
    }
}

#[test]
fn streams_that_are_none_or_shared_are_refused() {
    let (bytes, _) = spz(0);
    let refused = |change: &dyn Fn(&str) -> String| {
        let (file, _) = file(&bytes, NAMES[0], "");
        let start = buffer_start(&file);
        let text = change(std::str::from_utf8(&file[20..start - 8]).unwrap().trim_end());
        read(&glb(&text, &file[start..file.len() - 6 - 12])).unwrap_err()
    };
    assert!(refused(&|t| t.replace("\"bufferView\":1", "\"bufferView\":0")).contains("bufferView 0 is no SPZ"));
    assert!(refused(&|t| t.replace("\"bufferView\":1", "\"bufferView\":7")).contains("bufferView 7 of 3"));
    let shared = refused(&|t| t.replace("{\"buffer\":0,\"byteLength\":16}", "{\"buffer\":0,\"byteLength\":17}"));
    assert!(
        shared.contains("bufferView 0 shares bytes with the SPZ of bufferView 1"),
        "{shared}"
    );
    let short = refused(&|t| {
        t.replace(
            "\"byteOffset\":16,\"byteLength\":",
            "\"byteOffset\":16,\"byteLength\":1,\"x\":",
        )
    });
    assert!(short.contains("primitive 0 of mesh 0"), "{short}");
    let other = refused(&|t| t.replace(NAMES[0], "EXT_other"));
    assert!(
        other.contains("KHR_gaussian_splatting.extensions has \"EXT_other\", which is not read"),
        "{other}"
    );
}
