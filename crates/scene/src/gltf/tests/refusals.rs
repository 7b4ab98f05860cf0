//! What is no scene, or none that can be read, is refused with what is wrong with it.
use super::*;

/// Why the asset is refused with another JSON.
fn reason(old: &str, new: &str) -> String {
    let text = json(None);
    assert!(text.contains(old), "{old}");
    read(&glb(&text.replacen(old, new, 1), &buffer())).expect_err(new)
}

#[test]
fn nodes_that_gaussians_cannot_follow() {
    for (old, new, expected) in [
        (
            "\"scale\":[2,2,2]",
            "\"scale\":[2,2,1]",
            "node 1: scale [2.0, 2.0, 1.0]",
        ),
        (
            "\"scale\":[2,2,2]",
            "\"scale\":[2,0,2]",
            "must be finite, and scales more than 0",
        ),
        ("\"scale\":[2,2,2]", "\"scale\":[-2,2,2]", "mirrors"),
        ("\"scale\":[2,2,2]", "\"scale\":[1e300,1e300,1e300]", "must be finite"),
        ("\"matrix\":[0.36,0.48,-0.8,", "\"matrix\":[0.6,0.8,0,", "shears"),
        ("{\"mesh\":0,", "{\"mesh\":0,\"skin\":0,", "node 1: skin"),
        (
            "{\"mesh\":0,",
            "{\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancing\":{}},",
            "EXT_mesh_gpu_instancing",
        ),
        (
            "{\"mesh\":0,",
            "{\"mesh\":1,\"name\":\"bad\",",
            "node 2: mesh 1 of splats is at node 1 too",
        ),
        ("{\"mesh\":0,", "{\"mesh\":9,", "mesh 9 of 2"),
        (
            "\"children\":[1,2,3]",
            "\"children\":[1,2,2]",
            "node 2 is in the scene twice",
        ),
        (
            "\"children\":[1,2,3]",
            "\"children\":[1,0]",
            "node 0 is in the scene twice",
        ),
        ("\"children\":[1,2,3]", "\"children\":[9]", "node 9 of 4"),
        (
            "\"children\":[1,2,3]",
            "\"children\":[3]",
            "whose scene shows no primitive with KHR_gaussian_splatting",
        ),
        ("\"scene\":1,", "\"scene\":2,", "scene 2 of 2"),
        ("\"scene\":1,", "\"scene\":0,", "shows no primitive"),
    ] {
        let told = reason(old, new);
        assert!(told.contains(expected), "{new}: {told}");
    }
}

#[test]
fn splats_of_other_kinds() {
    for (old, new, expected) in [
        (
            "{\"mode\":0,",
            "{\"mode\":4,",
            "primitive 1 of mesh 0: mode is 4, must be 0",
        ),
        ("{\"mode\":0,", "{", "mode is 4"),
        ("{\"mode\":0,", "{\"mode\":0,\"targets\":[],", "targets"),
        (
            "\"kernel\":\"ellipse\"",
            "\"kernel\":\"disc\"",
            "KHR_gaussian_splatting.kernel is \"disc\"; \"ellipse\" is read",
        ),
        (
            "srgb_rec709_display",
            "lin_rec709_display",
            "colorSpace is \"lin_rec709_display\"",
        ),
        ("\"extras\":[1e2]", "\"projection\":\"orthographic\"", "projection"),
        ("\"extras\":[1e2]", "\"sortingMethod\":\"none\"", "sortingMethod"),
        (
            "\"KHR_gaussian_splatting:SCALE\": 3",
            "\"SIZE\": 3",
            "no attribute KHR_gaussian_splatting:SCALE",
        ),
        ("\"POSITION\": 1", "\"_POSITION\": 1", "no attribute POSITION"),
        (
            "SH_DEGREE_1_COEF_1",
            "SH_DEGREE_1_COEF_3",
            "SH_DEGREE_1_COEF_3: spherical harmonics have the degrees 0 to 3",
        ),
        ("SH_DEGREE_1_COEF_1", "SH_DEGREE_4_COEF_0", "the degrees 0 to 3"),
        (
            "\"KHR_gaussian_splatting:SH_DEGREE_1_COEF_1\": 7",
            "\"_X\": 7",
            "no attribute KHR_gaussian_splatting:SH_DEGREE_1_COEF_1",
        ),
        ("SH_DEGREE_1_COEF_1\": 7", "SH_DEGREE_1_COEF_1\": 5", "share bytes"),
        ("SH_DEGREE_1_COEF_1\": 7", "SH_DEGREE_1_COEF_1\": 1", "share bytes"),
    ] {
        let told = reason(old, new);
        assert!(told.contains(expected), "{new}: {told}");
    }
}

#[test]
fn accessors_and_what_they_are_in() {
    let first = r#"{"bufferView":1,"byteOffset":0,"componentType":5126"#;
    let rotation = r#"{"bufferView":3,"byteOffset":0,"componentType":5120,"normalized":true,"count":3"#;
    for (old, new, expected) in [
        (
            "\"POSITION\": 1",
            "\"POSITION\": 99",
            "attribute POSITION: accessor 99 of 29",
        ),
        (
            first,
            &first.replace("5126", "5125"),
            "accessor 1: Vec3 of componentType 5125; must be Vec3 of 5126, 5120",
        ),
        (first, &first.replace("{", "{\"sparse\":{},"), "accessor 1: sparse"),
        (
            first,
            &first.replace("\"bufferView\":1,", ""),
            "accessor 1: no bufferView",
        ),
        (
            first,
            &first.replace("View\":1", "View\":77"),
            "accessor 1: bufferView 77 of 7",
        ),
        (
            first,
            &first.replace("Offset\":0", "Offset\":99"),
            "elements of 96 bytes from byteOffset 99; its bufferView has 480 bytes",
        ),
        (
            first,
            &first.replace("Offset\":0", "Offset\":18446744073709551615"),
            "its bufferView has 480 bytes",
        ),
        (
            rotation,
            &rotation.replace("true", "false"),
            "accessor 10: Vec4 of componentType 5120; must be",
        ),
        (
            rotation,
            &rotation.replace("\"count\":3", "\"count\":2"),
            "attributes of 3 and of 2 splats",
        ),
        (
            rotation,
            &rotation.replace("\"count\":3", "\"count\":4000000000000"),
            "4000000000000 elements of 4 bytes",
        ),
        (
            "\"byteStride\":96",
            "\"byteStride\":8",
            "byteStride 8 of its bufferView; must be 12 to 252",
        ),
        ("\"byteStride\":96", "\"byteStride\":256", "byteStride 256"),
        (
            "{\"buffer\":0,\"byteOffset\":36",
            "{\"buffer\":1,\"byteOffset\":36",
            "bufferView 1: buffer 1 of 1",
        ),
        (
            "{\"buffer\":0,\"byteOffset\":36",
            "{\"extensions\":{\"EXT_meshopt_compression\":{}},\"buffer\":0,\"byteOffset\":36",
            "EXT_meshopt_compression",
        ),
        (
            "\"name\":\"all\"",
            "\"uri\":\"data:text/plain,abc\"",
            "buffer 0: a data URI that is not base64",
        ),
        (
            "\"name\":\"all\"",
            "\"uri\":\"data:x/y;base64,a*c=\"",
            "buffer 0: its data URI is no base64",
        ),
        (
            "\"name\":\"all\"",
            "\"uri\":\"data:x/y;base64,AAAA\"",
            "truncated: byteLength",
        ),
        ("\"version\":\"2.0\"", "\"version\":\"1.0\"", "asset.version \"1.0\""),
        ("\"asset\"", "\"assets\"", "missing field `asset`"),
        ("\"scene\":1,", "\"scene\":1,\"scene\":1,", "duplicate field `scene`"),
    ] {
        let told = reason(old, new);
        assert!(told.contains(expected), "{new}: {told}");
    }
}

#[test]
fn files_that_end_early_or_are_of_another_kind() {
    let file = asset();
    let told = |bytes: &[u8]| read(bytes).unwrap_err();
    assert!(told(&file[..8]).contains("truncated: 8 bytes of a header of 12"));
    assert!(told(&file[..500]).contains("truncated: the header promises"));
    let mut other = file.clone();
    other[4] = 1;
    assert!(told(&other).contains("binary glTF of version 1; version 2 is read"));
    let mut other = file.clone();
    other[16] = b'X';
    assert!(told(&other).contains("the first chunk of a binary glTF must be its JSON"));
    let mut other = file.clone();
    other[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(told(&other).contains("the chunk at byte 12 has 4294967295 bytes"));
    let mut other = file.clone();
    other[40] = 0xff;
    assert!(told(&other).contains("byte 40 of its JSON is not UTF-8"));
    let mut other = file;
    other.truncate(buffer_start(&other) - 8);
    let length = other.len() as u32;
    other[8..12].copy_from_slice(&length.to_le_bytes());
    assert!(told(&other).contains("buffer 0: no uri, and it is not the chunk of a binary glTF"));
    assert!(told(b"{\"a\":").contains("not a glTF scene: its JSON: EOF"));
    assert!(told(format!("{{\"a\":{}", "[".repeat(5000)).as_bytes()).contains("its JSON: EOF"));
    assert!(told(b"{\"position\":[0,0,1]}").contains("missing field `asset`"));
}

#[test]
fn arrays_have_a_limit_and_memory_too() {
    let many = format!(
        "\"accessors\":[{}",
        "{\"componentType\":5126,\"count\":1,\"type\":\"VEC3\"},".repeat(1 << 17)
    );
    assert!(reason("\"accessors\":[", &many).contains("more than 131072 elements, the limit"));
    let long = format!("\"asset\":{{\"extras\":\"{}\",", "x".repeat(16 << 20));
    assert!(reason("\"asset\":{", &long).contains("bytes of JSON besides the buffers in it; the limit is 16777216"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("it.glb");
    std::fs::write(&path, asset()).unwrap();
    let within = |memory| Scene::read_within(&path, BadRows::Refuse, memory);
    let size = asset().len() as u64;
    let needed = size + 5 * 4 * (11 + 12) + 3 * 4 * (11 + 48);
    assert!(within(needed).is_ok());
    for memory in [0, size - 1, needed - 1] {
        assert!(matches!(within(memory), Err(Error::DoesNotFit { .. })), "{memory}");
    }
}
