//! The cameras of a glTF, whose axes are those of OpenGL (x right, y up, z backward), as cameras with pixels.
use super::camera::Camera;
use super::files::{UNSTATED_SIDE, assemble};
use crate::scene::{GltfCamera, gltf_cameras};

/// The cameras that a glTF shows.
pub(super) fn from_gltf(file: &[u8]) -> Result<Vec<Camera>, String> {
    let cameras = gltf_cameras(file)?;
    if cameras.is_empty() {
        return Err("a glTF without a perspective camera in its scene".into());
    }
    let each = cameras.iter().enumerate();
    each.map(|(i, camera)| from_gltf_camera(camera).map_err(|reason| format!("camera {i}: {reason}")))
        .collect()
}

fn from_gltf_camera(camera: &GltfCamera) -> Result<Camera, String> {
    let [x, y, z] = camera.axes;
    let focal = 0.5 * UNSTATED_SIDE / (0.5 * camera.field_of_view).tan();
    let width = (UNSTATED_SIDE * camera.aspect_ratio.unwrap_or(1.0)).round();
    assemble(
        [x, y.map(|v| -v), z.map(|v| -v)],
        camera.position,
        [focal; 2],
        [None; 2],
        [width, UNSTATED_SIDE],
    )
}

#[cfg(test)]
mod tests {
    use crate::view::parse_cameras;

    /// Two cameras, one of them under a node that turns, scales and shifts, and one that no scene shows.
    const GLTF: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
        "nodes": [{"rotation": [0, 0, 0.7071067811865476, 0.7071067811865476], "scale": [2, 2, 2], "translation": [1, 0, 0],
            "children": [1]}, {"camera": 1, "translation": [0, 0, 3]}, {"camera": 0, "name": "eye"}, {"camera": 1}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.5, "znear": 0.1}},
            {"type": "perspective", "perspective": {"yfov": 0.6911112, "znear": 0.1}}]}"#;

    /// As a binary file of which only the beginning is there.
    fn binary(json: &str) -> Vec<u8> {
        let words = [2, 1 << 30, json.len() as u32].map(u32::to_le_bytes).concat();
        [b"glTF", &words[..], b"JSON", json.as_bytes(), &[9; 8]].concat()
    }

    #[test]
    fn cameras_of_a_gltf_are_where_its_nodes_put_them() {
        for file in [GLTF.as_bytes().to_vec(), binary(GLTF)] {
            let [turned, eye] = parse_cameras(&file).unwrap().try_into().unwrap();
            // Looks along -z from (1, 0, 6), a quarter turn about z: right is the world's y, up its -x.
            assert_eq!(turned.centre().map(|v| (v * 1e3).round()), [1e3, 0.0, 6e3]);
            let seen = turned.to_camera([1.5, 0.25, 4.0]).map(|v| (v * 1e3).round());
            assert_eq!(seen, [250.0, 500.0, 2000.0]);
            assert_eq!((turned.width, turned.height), (800, 800));
            assert!((turned.fx - 1111.11).abs() < 0.1 && turned.fx == turned.fy);
            assert_eq!((eye.width, eye.height), (1200, 800));
            assert_eq!(eye.to_camera([1.0, 2.0, -4.0]), [1.0, -2.0, 4.0]);
        }
    }

    #[test]
    fn what_is_wrong_with_a_gltf_is_named() {
        for (from, to, expected) in [
            ("\"camera\": 0", "\"camera\": 7", "node 2 (\"eye\"): camera 7 of 2"),
            ("1.0,", "4.0,", "yfov is 4, must be"),
            ("1.5", "0", "aspectRatio is 0, must be"),
            ("1.5", "99", "width is 79200, must be"),
            ("[2, 2, 2]", "[2, 0, 2]", "a scale of 0; must be"),
            ("[2, 2, 2]", "[2, -2, 2]", "camera 0: its rotation is not one"),
            ("\"2.0\"", "\"1.0\"", "version 2.0 is read"),
            ("\"children\": [1]", "\"children\": [0]", "node 0 is in the scene twice"),
            ("[0, 2]", "[]", "without a perspective camera"),
        ] {
            let reason = parse_cameras(GLTF.replacen(from, to, 1).as_bytes()).unwrap_err();
            assert!(reason.contains(expected), "{reason} does not have {expected}");
        }
        let orthographic = GLTF.replace("\"perspective\": {", "\"orthographic\": {");
        let reason = parse_cameras(orthographic.as_bytes()).unwrap_err();
        assert!(reason.contains("without a perspective camera"), "{reason}");
        for bytes in [&binary(GLTF)[..30], &binary(GLTF)[..8], b"glTF"] {
            assert!(parse_cameras(bytes).unwrap_err().contains("truncated"));
        }
    }
}
