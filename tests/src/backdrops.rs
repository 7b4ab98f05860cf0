//! Views laid over backdrops, as others show scenes.
use image::RgbImage;

/// A picture over a backdrop, of what it is over white and over black. The backdrop is a colour for each place, both in
/// shares.
pub fn over(backdrop: impl Fn(f32, f32) -> [f32; 3], white: &RgbImage, black: &RgbImage) -> RgbImage {
    let mut picture = black.clone();
    let (width, height) = (picture.width() as f32, picture.height() as f32);
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let behind = backdrop(x as f32 / width, y as f32 / height);
        for (c, value) in pixel.0.iter_mut().enumerate() {
            let shows = white.get_pixel(x, y).0[c].saturating_sub(*value);
            *value = (f32::from(*value) + f32::from(shows) * behind[c]).round() as u8;
        }
    }
    picture
}

/// Squares of four colours, in stripes: busy, as photographs are.
pub fn busy(x: f32, y: f32) -> [f32; 3] {
    let square = ((9.0 * x) as usize + 3 * (7.0 * y) as usize) % 4;
    let colour = [[0.8, 0.5, 0.3], [0.1, 0.3, 0.15], [0.5, 0.6, 0.8], [0.15, 0.1, 0.2]][square];
    colour.map(|v| v + 0.05 * x * y + 0.02 * (40.0 * x).sin())
}

/// A filter of phones: black lifted, each channel bent another way.
pub fn filtered(mut picture: RgbImage) -> RgbImage {
    let filter = |v: f32, c: usize| [0.05 + 0.9 * v.powf(0.8), 0.02 + 0.9 * v, 0.9 * v.powf(1.2)][c];
    for pixel in picture.pixels_mut() {
        for (c, value) in pixel.0.iter_mut().enumerate() {
            *value = (255.0 * filter(f32::from(*value) / 255.0, c)).round() as u8;
        }
    }
    picture
}
