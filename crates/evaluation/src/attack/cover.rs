//! Rectangles that hide parts of a picture.
use image::{Rgb, RgbImage};
use rand_chacha::ChaCha8Rng;

use super::draw::{ratio, up_to};

/// Fills `count` rectangles, each of an equal part of `share` of the area or a little less, at places that are uniform
/// over those inside. The ratio of their sides lies from `1 / stretch` to `stretch`, as far as the picture has room. They
/// may overlap, and so cover less together.
pub(super) fn cover(
    mut picture: RgbImage,
    share: f64,
    count: u32,
    stretch: f64,
    fill: Rgb<u8>,
    random: &mut ChaCha8Rng,
) -> RgbImage {
    let (width, height) = picture.dimensions();
    let area = share * f64::from(width) * f64::from(height) / f64::from(count);
    for _ in 0..count {
        let ideal = (area * ratio(random, stretch)).sqrt();
        // Not so low that it becomes wider than the picture. Rounded up, it still has no more than its area.
        let tall = ideal.max(area / f64::from(width)).ceil().clamp(1.0, f64::from(height));
        let wide = (area / tall).floor().min(f64::from(width));
        let (tall, wide) = (tall as u32, wide as u32);
        let left = up_to(random, width - wide);
        let top = up_to(random, height - tall);
        for y in top..top + tall {
            for x in left..left + wide {
                picture.put_pixel(x, y, fill);
            }
        }
    }
    picture
}
