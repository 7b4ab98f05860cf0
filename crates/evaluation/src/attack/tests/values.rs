//! Values computed by hand.
use image::{Rgb, RgbImage};

use super::{done, greys, row, varied};
use crate::attack::filter::gaussian;

fn pixel(text: &str, colour: [u8; 3]) -> [u8; 3] {
    done(text, &RgbImage::from_pixel(1, 1, Rgb(colour))).get_pixel(0, 0).0
}

#[test]
fn tones_follow_their_formulas() {
    assert_eq!(
        greys(&done("brightness:1.5", &row(&[0, 101, 170, 255]))),
        [0, 152, 255, 255]
    );
    // The mean is 100.
    assert_eq!(greys(&done("contrast:0.5", &row(&[0, 200]))), [50, 150]);
    assert_eq!(greys(&done("contrast:2", &row(&[0, 90, 210]))), [0, 80, 255]);
    // 255 (128 / 255)^2 = 64.25; 255 (64 / 255)^0.5 = 127.75.
    assert_eq!(greys(&done("gamma:2", &row(&[0, 128, 255]))), [0, 64, 255]);
    assert_eq!(greys(&done("gamma:0.5", &row(&[64]))), [128]);
    assert_eq!(greys(&done("fade:0.2", &row(&[0, 100, 255]))), [51, 131, 255]);
    assert_eq!(greys(&done("fade:-0.2", &row(&[0, 100, 255]))), [0, 69, 255]);
    // At a quarter the sine is 1: 64 - 255 · 0.5 / 6.2832 = 43.7.
    assert_eq!(greys(&done("curve:0.5", &row(&[0, 64, 191, 255]))), [0, 44, 211, 255]);
    assert_eq!(greys(&done("bits:1", &row(&[0, 127, 128, 255]))), [0, 0, 255, 255]);
    // Steps of 85, the middle between two of them being 127.5.
    assert_eq!(
        greys(&done("bits:2", &row(&[42, 43, 100, 128, 213]))),
        [0, 85, 85, 170, 255]
    );
}

#[test]
fn a_vignette_darkens_corners_and_not_the_middle() {
    let white = RgbImage::from_pixel(401, 201, Rgb([200, 100, 0]));
    let darker = done("vignette:0.5", &white);
    assert_eq!(darker.get_pixel(200, 100).0, [200, 100, 0]);
    assert_eq!(darker.get_pixel(0, 200).0, [101, 50, 0]);
    // Half of the way to a corner a quarter of that is missing.
    assert_eq!(darker.get_pixel(100, 50).0, [175, 88, 0]);
    assert_eq!(done("vignette:0", &white), white);
}

#[test]
fn tints_change_each_channel() {
    assert_eq!(pixel("tint:1.05/1/0.95", [100, 100, 100]), [105, 100, 95]);
    assert_eq!(pixel("tint:2", [10, 130, 200]), pixel("brightness:2", [10, 130, 200]));
    assert_eq!(done("tint:1/1/1", &varied(5, 4)), varied(5, 4));
}

#[test]
fn colours_follow_their_formulas() {
    // 0.299 · 255 = 76.2; 0.299 · 100 + 0.587 · 150 + 0.114 · 200 = 140.75.
    assert_eq!(pixel("grey", [255, 0, 0]), [76; 3]);
    assert_eq!(pixel("grey", [100, 150, 200]), [141; 3]);
    assert_eq!(pixel("saturation:2", [100, 150, 200]), [59, 159, 255]);
    assert_eq!(pixel("saturation:0.5", [100, 150, 200]), [120, 145, 170]);
    let third = 1.0 / 3.0;
    assert_eq!(pixel(&format!("hue:{third}"), [200, 10, 10]), [10, 200, 10]);
    assert_eq!(pixel(&format!("hue:-{third}"), [200, 10, 10]), [10, 10, 200]);
    // Opposite hues: 30° and 210°.
    assert_eq!(pixel("hue:0.5", [255, 128, 0]), [0, 127, 255]);
    // A sixth of the circle leads from red to yellow, a twelfth half the way.
    assert_eq!(pixel(&format!("hue:{}", third / 4.0), [200, 0, 0]), [200, 100, 0]);
    assert_eq!(pixel("hue:0.3", [77; 3]), [77; 3]);
    assert_eq!(done("hue:1", &varied(40, 40)), varied(40, 40));
}

#[test]
fn kernels_are_those_of_torchvision() {
    // σ = 0.8: exp(-1 / 1.28) = 0.457833, of 1.915667 in all.
    let three = gaussian(3);
    assert!(
        (three[0] - 0.238994).abs() < 1e-5 && (three[1] - 0.522011).abs() < 1e-5,
        "{three:?}"
    );
    // σ = 1.1: exp(-1 / 2.42) = 0.661524, exp(-4 / 2.42) = 0.191507, of 2.706062 in all.
    let five = gaussian(5);
    assert!(
        (five[0] - 0.070770).abs() < 1e-5 && (five[1] - 0.244460).abs() < 1e-5,
        "{five:?}"
    );
    assert!((gaussian(31).iter().sum::<f32>() - 1.0).abs() < 1e-5);
}

#[test]
fn blur_spreads_a_point_and_mirrors_edges_without_repeating_them() {
    let mut point = RgbImage::new(5, 5);
    point.put_pixel(2, 2, Rgb([255; 3]));
    let blurred = done("blur:3", &point);
    let at = |x, y| blurred.get_pixel(x, y).0[0];
    // 255 times 0.5220², 0.5220 · 0.2390, 0.2390².
    assert_eq!([at(2, 2), at(1, 2), at(2, 3), at(1, 1), at(4, 2)], [69, 32, 32, 15, 0]);
    let mut corner = RgbImage::new(5, 5);
    corner.put_pixel(0, 0, Rgb([255; 3]));
    let blurred = done("blur:3", &corner);
    let at = |x, y| blurred.get_pixel(x, y).0[0];
    assert_eq!([at(0, 0), at(1, 0), at(0, 1), at(1, 1)], [69, 32, 32, 15]);
    // The neighbour of the edge counts twice there: 255 · 2 · 0.2390.
    assert_eq!(greys(&done("blur:3", &row(&[0, 255, 0, 0]))), [122, 133, 61, 0]);
}

#[test]
fn median_takes_the_middle_and_repeats_edges() {
    let values = [[9, 1, 8], [2, 200, 7], [3, 6, 4]];
    let picture = RgbImage::from_fn(3, 3, |x, y| Rgb([values[y as usize][x as usize]; 3]));
    let result = done("median:3", &picture);
    // 1 2 3 4 6 7 8 9 200; and in the corner 1 1 2 2 9 9 9 9 200.
    assert_eq!(result.get_pixel(1, 1).0, [6; 3]);
    assert_eq!(result.get_pixel(0, 0).0, [9; 3]);
}

#[test]
fn sharpening_moves_away_from_the_smooth_picture() {
    let mut picture = RgbImage::from_pixel(3, 3, Rgb([50; 3]));
    picture.put_pixel(1, 1, Rgb([100; 3]));
    // Smooth is (8 · 50 + 5 · 100) / 13 = 69.23.
    assert_eq!(done("sharpen:2", &picture).get_pixel(1, 1).0, [131; 3]);
    assert_eq!(done("sharpen:0", &picture).get_pixel(1, 1).0, [69; 3]);
    assert_eq!(done("sharpen:2", &picture).get_pixel(0, 1).0, [50; 3]);
}

#[test]
fn shrinking_weighs_with_a_widened_triangle() {
    // Weights 0.75, 0.75, 0.25 of 1.75, as Pillow's bilinear: 125 / 1.75 and 250 / 1.75.
    assert_eq!(greys(&done("scale:0.5", &row(&[0, 100, 200, 100]))), [71, 143]);
    // Back again: 0.75 and 0.25 of neighbours, and the edge repeated.
    assert_eq!(
        greys(&done("rescale:0.5", &row(&[0, 100, 200, 100]))),
        [71, 89, 125, 143]
    );
    assert_eq!(
        greys(&done("scale:2", &row(&[100, 200]))),
        [[100, 125, 175, 200]; 2].concat()
    );
}
