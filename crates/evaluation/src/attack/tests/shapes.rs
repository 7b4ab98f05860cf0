//! Which pixels stay, and where they go.
use image::imageops::{crop_imm, flip_horizontal, rotate90, rotate180, rotate270};
use image::{Rgb, RgbImage};

use super::{attack, done, varied};
use crate::attack::{MAX_SIDE, testing::psnr};

fn size(text: &str, width: u32, height: u32) -> (u32, u32) {
    done(text, &RgbImage::new(width, height)).dimensions()
}

#[test]
fn sizes_are_shares_to_the_nearest_pixel() {
    assert_eq!(size("scale:0.75", 101, 50), (76, 38));
    assert_eq!(size("scale:1.25", 101, 50), (126, 63));
    assert_eq!(size("rescale:0.3", 101, 50), (101, 50));
    assert_eq!(size("fit:512", 1000, 501), (512, 257));
    assert_eq!(size("fit:512", 300, 512), (300, 512));
    assert_eq!(size("window:512", 1000, 300), (512, 300));
    assert_eq!(size("border:0.5", 10, 4), (14, 8));
    assert_eq!(size("page:0.4", 10, 4), (25, 10));
    assert_eq!(size("quarter-turns:1", 10, 4), (4, 10));
    assert_eq!(size("rotate:30", 10, 4), (10, 4));
    assert_eq!(size("crop:0.01", 30, 7), (1, 1));
}

#[test]
fn crops_keep_the_pixels_of_their_window() {
    let picture = varied(10, 20);
    let window = |left, top, width, height| crop_imm(&picture, left, top, width, height).to_image();
    assert_eq!(done("crop:0.4", &picture), window(3, 6, 4, 8));
    assert_eq!(done("crop:0.6", &picture), window(2, 4, 6, 12));
    assert_eq!(done("window:12", &picture), window(0, 4, 10, 12));
    let random = done("crop-random:0.5", &picture);
    let places = (0..=5).flat_map(|left| (0..=10).map(move |top| (left, top)));
    let found = places
        .filter(|(left, top)| random == window(*left, *top, 5, 10))
        .count();
    assert_eq!(found, 1);
}

#[test]
fn random_crops_reach_every_place() {
    let picture = varied(4, 1);
    let crop = attack("crop-random:0.5");
    for left in 0..=2 {
        let window = crop_imm(&picture, left, 0, 2, 1).to_image();
        let hits = (0..300).filter(|index| crop.apply(&picture, 5, *index).unwrap() == window);
        assert!((70..130).contains(&hits.count()), "place {left}");
    }
}

#[test]
fn borders_are_white_and_outside() {
    let picture = varied(10, 4);
    let framed = done("border:0.5", &picture);
    assert_eq!(crop_imm(&framed, 2, 2, 10, 4).to_image(), picture);
    let white = framed.pixels().filter(|pixel| pixel.0 == [255; 3]).count();
    assert_eq!(white, 14 * 8 - 10 * 4);
}

#[test]
fn pages_have_the_picture_in_one_piece_and_much_else() {
    let picture = varied(40, 20);
    let mut places = std::collections::BTreeSet::new();
    for index in 0..20 {
        let page = attack("page:0.5").apply(&picture, 3, index).unwrap();
        let all = (0..=40).flat_map(|left| (0..=20).map(move |top| (left, top)));
        let at = |&(left, top): &(u32, u32)| crop_imm(&page, left, top, 40, 20).to_image() == picture;
        let found: Vec<_> = all.filter(at).collect();
        assert_eq!(found.len(), 1);
        places.extend(found);
        let plain = page.pixels().filter(|pixel| pixel.0 == [255; 3]).count();
        assert!(
            (1000..2400 * 3 / 4).contains(&plain),
            "{plain} of 2,400 pixels beside the picture"
        );
    }
    assert!(places.len() > 15, "{places:?}");
}

#[test]
fn right_angles_move_pixels_without_mixing_them() {
    let picture = varied(16, 16);
    // Counterclockwise, where the names of `image` are clockwise.
    for (degrees, expected) in [
        (0, picture.clone()),
        (90, rotate270(&picture)),
        (180, rotate180(&picture)),
        (270, rotate90(&picture)),
        (360, picture.clone()),
        (-90, rotate90(&picture)),
    ] {
        assert_eq!(done(&format!("rotate:{degrees}"), &picture), expected, "{degrees}");
    }
    assert_eq!(done("quarter-turns:1", &picture), rotate270(&picture));
    assert_eq!(done("quarter-turns:2", &picture), rotate180(&picture));
    assert_eq!(done("quarter-turns:3", &picture), rotate90(&picture));
    assert_eq!(done("rotate:180", &varied(7, 4)), rotate180(&varied(7, 4)));
    assert_eq!(done("flip", &picture), flip_horizontal(&picture));
    assert_eq!(done("flip+flip", &picture), picture);
}

#[test]
fn a_point_right_of_the_centre_rises_as_it_turns() {
    let mut picture = RgbImage::new(101, 101);
    picture.put_pixel(90, 50, Rgb([255; 3]));
    let turned = done("rotate:30", &picture);
    let light: f64 = turned.pixels().map(|pixel| f64::from(pixel.0[0])).sum();
    let mean = |position: fn(u32, u32) -> u32| {
        let moments = turned.enumerate_pixels();
        moments
            .map(|(x, y, pixel)| f64::from(position(x, y)) * f64::from(pixel.0[0]))
            .sum::<f64>()
            / light
    };
    // 40 (cos 30°, sin 30°) from the centre, up being towards smaller rows.
    let (x, y) = (mean(|x, _| x), mean(|_, y| y));
    assert!((x - 84.64).abs() < 0.2 && (y - 30.0).abs() < 0.2, "{x} {y}");
}

#[test]
fn turning_there_and_back_keeps_the_middle_and_blackens_corners() {
    let smooth = RgbImage::from_fn(64, 64, |x, y| Rgb([(100 + x) as u8, (100 + y) as u8, 150]));
    let turned = done("rotate:30", &smooth);
    for (x, y) in [(0, 0), (63, 0), (0, 63), (63, 63)] {
        assert_eq!(turned.get_pixel(x, y).0, [0; 3]);
    }
    let back = done("rotate:30+rotate:-30", &smooth);
    let middle = |picture| crop_imm(picture, 20, 20, 24, 24).to_image();
    assert!(psnr(&middle(&back), &middle(&smooth)).unwrap() > 48.0);
}

#[test]
fn rectangles_cover_what_they_are_asked_to() {
    let white = RgbImage::from_pixel(200, 100, Rgb([255; 3]));
    let covered = |text: &str, index, fill: u8| {
        let picture = attack(text).apply(&white, 3, index).unwrap();
        assert!(picture.pixels().all(|pixel| [[255; 3], [fill; 3]].contains(&pixel.0)));
        picture.pixels().filter(|pixel| pixel.0 == [fill; 3]).count() as f64 / 20_000.0
    };
    for index in 0..50 {
        let mask = covered("mask:0.2", index, 128);
        assert!((0.05..=0.2).contains(&mask), "{mask}");
        let erased = covered("erase:0.2", index, 0);
        assert!((0.19..=0.2).contains(&erased), "{erased}");
        assert_eq!(covered("erase:1", index, 0), 1.0);
        assert!((0.2..=1.0).contains(&covered("mask:1", index, 128)));
    }
}

#[test]
fn sizes_beyond_the_limits_are_refused() {
    let refused = |text: &str, width, height| {
        let error = attack(text).apply(&RgbImage::new(width, height), 0, 0).unwrap_err();
        error.to_string()
    };
    assert!(refused("none", 0, 5).starts_with("size of the picture: 0x5 is not 1 to 16383"));
    assert!(refused("none", MAX_SIDE + 1, 1).contains("16384x1 is not"));
    assert!(refused("scale:4", 5000, 1).contains("20000x4 is not"));
    assert!(refused("scale:4", 2000, 2000).contains("8000x8000 is not"));
    assert!(refused("border:1+border:1+border:1+border:1+border:1+border:1", 1000, 10).contains("size"));
}
