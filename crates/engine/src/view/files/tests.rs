//! Files of cameras: what is read, and what is refused.
use super::*;

fn cameras() -> Vec<Camera> {
    let mut off_centre = Camera::look_at([3.0, -1.0, 0.5], [0.0; 3], [0.0, 0.0, 1.0], 0.7, 640, 480);
    off_centre.cx += 11.0;
    off_centre.fy *= 1.5;
    vec![
        Camera::look_at([0.0, 1.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 0.9, 99, 100),
        off_centre,
    ]
}

fn close(a: &Camera, b: &Camera) -> bool {
    let flat = |c: &Camera| {
        let pose = c.rotation.into_iter().flatten().chain(c.translation);
        pose.chain([c.fx, c.fy, c.cx, c.cy, c.width as f32, c.height as f32])
            .collect::<Vec<_>>()
    };
    flat(a)
        .iter()
        .zip(flat(b))
        .all(|(x, y)| (x - y).abs() < 1e-4 * (1.0 + y.abs()))
}

#[test]
fn both_kinds_come_back() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["cameras.json", "transforms.json"] {
        let path = folder.path().join(name);
        write_cameras(&path, &cameras()).unwrap();
        let read = read_cameras(&path).unwrap();
        assert_eq!(read.len(), 2);
        assert!(
            read.iter().zip(&cameras()).all(|(a, b)| close(a, b)),
            "{name}: {read:?}"
        );
    }
}

#[test]
fn a_blender_camera_looks_down_its_negative_z() {
    // The identity pose of OpenGL looks along -z with y up; 4 back from the origin.
    let text = br#"{"camera_angle_x": 0.6911112, "frames": [{"file_path": "./train/r_0",
            "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]}"#;
    let camera = parse_cameras(text).unwrap().remove(0);
    let p = camera.to_camera([1.0, 2.0, 0.0]);
    assert_eq!(p, [1.0, -2.0, 4.0]);
    assert_eq!((camera.width, camera.height), (800, 800));
    // Known from the NeRF synthetic set.
    assert!((camera.fx - 1111.11).abs() < 0.1, "{}", camera.fx);
}

#[test]
fn a_reference_camera_keeps_its_axes() {
    // camera x = world y, y = world z, z = world x: the columns of the stored rotation.
    let text = br#"[{"id": 0, "img_name": "a", "width": 10, "height": 20, "position": [1, 2, 3],
            "rotation": [[0,0,1],[1,0,0],[0,1,0]], "fy": 30, "fx": 40}]"#;
    let camera = parse_cameras(text).unwrap().remove(0);
    assert_eq!(camera.centre(), [1.0, 2.0, 3.0]);
    assert_eq!(camera.to_camera([6.0, 2.5, 4.0]), [0.5, 1.0, 5.0]);
    assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (40.0, 30.0, 5.0, 10.0));
}

#[test]
fn what_is_wrong_is_named() {
    let good = r#"[{"width": 10, "height": 20, "position": [1, 2, 3],
            "rotation": [[0,0,1],[1,0,0],[0,1,0]], "fy": 30, "fx": 40}]"#;
    assert!(parse_cameras(good.as_bytes()).is_ok());
    let cases = [
        ("\"width\": 10,", "", "camera 0: width is missing"),
        ("10", "1e9", "must be a whole number from 1 to 16384"),
        ("\"fx\": 40", "\"fx\": \"wide\"", "fx is \"wide\", not a number"),
        ("\"fx\": 40", "\"fx\": -1", "focal length in x is -1"),
        ("[1, 2, 3]", "[1, 2]", "position is missing or not 3 numbers"),
        ("[0,1,0]", "[0,-1,0]", "rotation"),
        ("[0,1,0]", "[0,2,0]", "rotation"),
        ("[1, 2, 3]", "[1, 2, 1e300]", "out of range"),
        ("\"fx\": 40", "\"fx\": 40, \"cx\": 1e300", "cx is out of range"),
        ("\"fx\": 40", "\"fx\": [4, 0]", "fx is a list, not a number"),
        ("[0,1,0]", "[0,1,[0]]", "rotation is missing or not 3 rows of 3 numbers"),
        ("[{", "{", "not JSON"),
    ];
    for (from, to, expected) in cases {
        let reason = parse_cameras(good.replacen(from, to, 1).as_bytes()).unwrap_err();
        assert!(reason.contains(expected), "{reason} does not have {expected}");
    }
    for (text, expected) in [
        ("[]", "no cameras"),
        ("{}", "no cameras.json"),
        ("3", "no cameras.json"),
        ("[1]", "camera 0"),
    ] {
        let reason = parse_cameras(text.as_bytes()).unwrap_err();
        assert!(reason.contains(expected), "{reason}");
    }
    let frame = r#"{"frames": [{"transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]}"#;
    assert!(
        parse_cameras(frame.as_bytes())
            .unwrap_err()
            .contains("neither fl_x nor camera_angle_x")
    );
}
