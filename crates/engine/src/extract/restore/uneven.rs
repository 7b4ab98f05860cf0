//! Grounds in uneven light: the dark corners of a photograph, a light from one side, a filter that makes such.
//!
//! One correction of tones for all of a picture can't undo that. Where a ground is seen all around it tells how bright the
//! light is where, and the scene is divided by it: a flat field, as it is called in photography, of the picture itself.
use super::smooth_ground::SmoothGround;
use crate::picture::Picture;

/// A ground is at least that bright: a dark one says little of the light.
const DARKEST: f64 = 0.25;

/// The picture in even light, as bright as where it is brightest; `None` where its ground is too dark to tell of the light.
pub(super) fn evened(picture: &Picture, ground: &SmoothGround) -> Option<Picture> {
    let even = |pixel: [f32; 3], light: [f64; 3]| {
        std::array::from_fn(|c| (f64::from(pixel[c]) * ground.brightest[c] / light[c]).clamp(0.0, 1.0) as f32)
    };
    let is_bright = ground.darkest.iter().all(|dark| *dark >= DARKEST);
    is_bright.then(|| ground.changed(picture, even))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::largest_difference;

    fn in_even_light(picture: &Picture) -> Option<Picture> {
        evened(picture, &SmoothGround::seen(picture)?)
    }

    /// A disc with a gradient, a fifth of it beyond the border, on a ground.
    fn disc(side: u32, ground: f32) -> Picture {
        of(side, |x, y| match (x + 0.5).hypot(y - 0.1) < 0.7 {
            true => [0.4 + 0.3 * x, 0.4, 0.5 + 0.3 * y],
            false => [ground; 3],
        })
    }

    /// The picture of a function of -1 to 1 along x and y.
    fn of(side: u32, pixel: impl Fn(f32, f32) -> [f32; 3]) -> Picture {
        let at = |i: u32| (2 * i + 1) as f32 / side as f32 - 1.0;
        let pixels = (0..side * side)
            .flat_map(|i| pixel(at(i % side), at(i / side)))
            .collect();
        Picture {
            width: side,
            height: side,
            pixels,
        }
    }

    /// In a light that falls off by `by` to the corners, and is redder at the right, 1 where it is brightest.
    fn lit(picture: &Picture, by: f32) -> Picture {
        let light = of(picture.width, |x, y| {
            let corners = 1.0 - by * (x * x + y * y) / 2.0;
            // Brightest at x = 0.2, y = 0.
            let red = (corners - 0.2 * by * (1.0 - x)) / (1.0 - 0.18 * by);
            [red, corners, corners]
        });
        let pixels = picture.pixels.iter().zip(&light.pixels).map(|(v, light)| v * light);
        Picture {
            pixels: pixels.collect(),
            ..*picture
        }
    }

    #[test]
    fn dark_corners_and_light_from_a_side_go_and_the_scene_is_as_it_was() {
        for (side, by) in [(400, 0.25), (400, 0.5), (61, 0.1)] {
            let clean = disc(side, 1.0);
            let even = in_even_light(&lit(&clean, by)).unwrap();
            assert!(
                largest_difference(&even, &clean) < 0.02,
                "{side} {by}: {}",
                largest_difference(&even, &clean)
            );
            assert!(in_even_light(&even).is_none());
        }
    }

    #[test]
    fn even_grounds_dark_ones_and_scenes_without_one_stay() {
        for picture in [
            disc(400, 1.0),
            disc(400, 0.5),
            disc(400, 0.0),
            lit(&disc(400, 0.1), 0.5),
        ] {
            assert!(in_even_light(&picture).is_none());
        }
        // Walls in soft light, with a corner between them, and a texture of some squares.
        let walls = of(400, |x, y| match x < 0.1 {
            true => [0.7 + 0.1 * x, 0.6 + 0.1 * y, 0.5],
            false => [0.5 - 0.2 * x, 0.5 + 0.1 * y, 0.45],
        });
        let tiles = of(400, |x, y| {
            [0.6 + 0.05 * (12.0 * x).sin() * (9.0 * y).cos() - 0.1 * x * x; 3]
        });
        assert!(in_even_light(&walls).is_none() && in_even_light(&tiles).is_none());
    }

    #[test]
    fn pictures_of_few_pixels_or_of_none_and_values_that_are_no_numbers_stay() {
        for side in [0, 1, 3, 5, 9] {
            assert!(in_even_light(&disc(side, 0.5)).is_none(), "{side}");
        }
        assert!(in_even_light(&of(100, |_, _| [f32::NAN; 3])).is_none());
        assert!(in_even_light(&of(100, |x, _| [if x > 0.5 { f32::INFINITY } else { 0.5 }; 3])).is_none());
    }
}
