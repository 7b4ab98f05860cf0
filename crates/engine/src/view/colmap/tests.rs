//! The same cameras in both kinds of files, and what is wrong with files.
use super::*;
use crate::view::read_cameras;

/// Two lenses and three images, of which the second by name has no points.
const CAMERAS: &str = "# a remark\n1 PINHOLE 640 480 500 510 320 240\n7 SIMPLE_RADIAL 100 50 80 50 25 0.1\n";
const IMAGES: &str = "# remarks\n\
    3 0.5 0.5 0.5 0.5 1 2 3 7 c.png\n1 2 -1 3 4 5\n\
    1 1 0 0 0 0 0 4 1 a b.png\n1.5 2.5 9\n\
    2 0 0 1 0 0.5 0 0 1 b.png\n\n";

fn folder(files: &[(&str, &[u8])]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

fn binary() -> [Vec<u8>; 2] {
    let mut cameras = 2_u64.to_le_bytes().to_vec();
    for (id, model, size, parameters) in [
        (1_u32, 1_u32, [640_u64, 480], &[500.0, 510.0, 320.0, 240.0_f64][..]),
        (7, 2, [100, 50], &[80.0, 50.0, 25.0, 0.1]),
    ] {
        cameras.extend(id.to_le_bytes());
        cameras.extend(model.to_le_bytes());
        cameras.extend(size.iter().flat_map(|side| side.to_le_bytes()));
        cameras.extend(parameters.iter().flat_map(|value| value.to_le_bytes()));
    }
    let mut images = 3_u64.to_le_bytes().to_vec();
    for (id, pose, camera, name, points) in [
        (3_u32, [0.5, 0.5, 0.5, 0.5, 1.0, 2.0, 3.0_f64], 7_u32, "c.png", 2_u64),
        (1, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0], 1, "a b.png", 1),
        (2, [0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 0.0], 1, "b.png", 0),
    ] {
        images.extend(id.to_le_bytes());
        images.extend(pose.iter().flat_map(|value| value.to_le_bytes()));
        images.extend(camera.to_le_bytes());
        images.extend(name.as_bytes());
        images.push(0);
        images.extend(points.to_le_bytes());
        images.extend(vec![3; (points * POINT) as usize]);
    }
    [cameras, images]
}

#[test]
fn both_kinds_give_the_same_cameras_in_the_order_of_names() {
    let [cameras, images] = binary();
    let text = folder(&[("cameras.txt", CAMERAS.as_bytes()), ("images.txt", IMAGES.as_bytes())]);
    let found = read_cameras(text.path()).unwrap();
    let both = folder(&[("cameras.bin", &cameras), ("images.bin", &images)]);
    assert_eq!(read_cameras(both.path()).unwrap(), found);
    // a b.png: 4 in front of a camera that looks along z.
    assert_eq!(found[0].to_camera([0.0; 3]), [0.0, 0.0, 4.0]);
    assert_eq!((found[0].width, found[0].fx, found[0].fy), (640, 500.0, 510.0));
    // b.png: half a turn about y.
    assert_eq!(found[1].to_camera([1.0, 2.0, 3.0]), [-0.5, 2.0, -3.0]);
    // c.png: x becomes y, y becomes z, z becomes x.
    let moved = found[2].to_camera([10.0, 20.0, 30.0]);
    assert!(
        moved.iter().zip([31.0, 12.0, 23.0]).all(|(a, b)| (a - b).abs() < 1e-5),
        "{moved:?}"
    );
    assert_eq!((found[2].cx, found[2].cy, found[2].fy), (50.0, 25.0, 80.0));
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    for (cameras, images, told) in [
        (
            "1 PINHOLE 640 480 500 510 320\n",
            IMAGES,
            "line 1: PINHOLE has 4 numbers",
        ),
        (
            "1 LOOKING_GLASS 640 480 500\n",
            IMAGES,
            "line 1: has a lens that is not known",
        ),
        (
            "1 OPENCV_FISHEYE 640 480 1 1 1 1 0 0 0 0\n",
            IMAGES,
            "undistort the images first",
        ),
        ("1 PINHOLE\n", IMAGES, "line 1: is not CAMERA_ID"),
        (
            "1 PINHOLE 640.5 480 500 510 320 240\n",
            "1 1 0 0 0 0 0 4 1 a\n\n",
            "image a: width is 640.5",
        ),
        (CAMERAS, "1 1 0 0 0 0 0 4 2 a\n\n", "image a: there is no camera 2"),
        (CAMERAS, "1 0 0 0 0 0 0 4 1 a\n\n", "image a: its rotation"),
        (CAMERAS, "1 1 0 0 0 0 0 nan 1 a\n\n", "image a: its position"),
        (CAMERAS, "1 1 0 0 0 0 0 4\n\n", "line 1: is not IMAGE_ID"),
        (CAMERAS, "# none\n", "has no images"),
        (CAMERAS, &"7".repeat(1 << 17), "line 1 is longer"),
    ] {
        let there = folder(&[("cameras.txt", cameras.as_bytes()), ("images.txt", images.as_bytes())]);
        let reason = read_cameras(there.path()).unwrap_err().to_string();
        assert!(reason.contains(told), "{reason} does not have {told}");
    }
    let empty = folder(&[]);
    assert!(
        read_cameras(empty.path())
            .unwrap_err()
            .to_string()
            .contains("cameras.txt")
    );
}

#[test]
fn files_that_are_cut_or_promise_too_much_are_refused() {
    let [cameras, images] = binary();
    for (cameras, images) in (0..images.len())
        .map(|end| (&cameras[..], &images[..end]))
        .chain((0..cameras.len()).map(|end| (&cameras[..end], &images[..])))
    {
        let there = folder(&[("cameras.bin", cameras), ("images.bin", images)]);
        read_cameras(there.path()).unwrap_err();
    }
    let many = folder(&[("cameras.bin", &cameras), ("images.bin", &[255; 64])]);
    let told = read_cameras(many.path()).unwrap_err().to_string();
    assert!(told.contains("at most 1048576"), "{told}");
}
