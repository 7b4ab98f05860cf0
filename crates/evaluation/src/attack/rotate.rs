//! Rotation by any angle, and by right angles.
use image::{Rgb, RgbImage, imageops};

/// Counterclockwise by right angles, 0 to 3.
pub(super) fn quarter_turns(picture: RgbImage, turns: u8) -> RgbImage {
    match turns {
        1 => imageops::rotate270(&picture),
        2 => imageops::rotate180(&picture),
        3 => imageops::rotate90(&picture),
        _ => picture,
    }
}

/// Counterclockwise by degrees about the centre, bilinear, at the same size; black where nothing was.
pub(super) fn rotate(picture: &RgbImage, degrees: f64) -> RgbImage {
    let (width, height) = picture.dimensions();
    let (sin, cos) = sin_cos(degrees);
    let centre = |size: u32| (f64::from(size) - 1.0) / 2.0;
    let (centre_x, centre_y) = (centre(width), centre(height));
    RgbImage::from_fn(width, height, |x, y| {
        let (x, y) = (f64::from(x) - centre_x, f64::from(y) - centre_y);
        // The turn back leads to where a pixel came from; y points down.
        bilinear(picture, centre_x + cos * x - sin * y, centre_y + sin * x + cos * y)
    })
}

/// Exact for right angles, so that they move pixels without mixing them.
fn sin_cos(degrees: f64) -> (f64, f64) {
    let degrees = degrees.rem_euclid(360.0);
    if degrees == 0.0 {
        (0.0, 1.0)
    } else if degrees == 90.0 {
        (1.0, 0.0)
    } else if degrees == 180.0 {
        (0.0, -1.0)
    } else if degrees == 270.0 {
        (-1.0, 0.0)
    } else {
        degrees.to_radians().sin_cos()
    }
}

/// The colour between four pixels, those outside being black.
fn bilinear(picture: &RgbImage, x: f64, y: f64) -> Rgb<u8> {
    let (left, top) = (x.floor(), y.floor());
    let (right_share, lower_share) = (x - left, y - top);
    let tap = |x: f64, y: f64| {
        if x < 0.0 || y < 0.0 {
            return [0.0; 3];
        }
        let pixel = picture.get_pixel_checked(x as u32, y as u32);
        pixel.map_or([0.0; 3], |pixel| pixel.0.map(f64::from))
    };
    let corners = [
        (tap(left, top), (1.0 - right_share) * (1.0 - lower_share)),
        (tap(left + 1.0, top), right_share * (1.0 - lower_share)),
        (tap(left, top + 1.0), (1.0 - right_share) * lower_share),
        (tap(left + 1.0, top + 1.0), right_share * lower_share),
    ];
    Rgb(std::array::from_fn(|channel| {
        let sum: f64 = corners.iter().map(|(pixel, weight)| weight * pixel[channel]).sum();
        sum.round() as u8
    }))
}
