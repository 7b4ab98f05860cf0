//! The ground behind a scene, where a picture shows it all around: noise, compression and changed tones leave it neither
//! black nor white any more, and then it weighs more in a reading than the scene does.
use crate::picture::Picture;
use crate::simd::{Instructions, Vectorised};

/// Distance from the ground's colour up to which a pixel is ground, and from which on it is none: noise and compression stay
/// within.
pub(in crate::extract) const DISTANCE: [f32; 2] = [0.06, 0.12];
/// The same of a ground that a viewer drew: a dark scene has colours that are hardly further from a dark ground.
const DRAWN: [f32; 2] = [0.02, 0.04];
/// Share of the border that must be ground.
const SHARE: f32 = 0.5;
/// Nearly all of a ground is this near to its colour; of the blurred surroundings of a scene, whose border varies slowly, a
/// smaller share of what is [near](DISTANCE).
const CORE: f32 = 0.04;
/// What share of them.
const OF_NEAR: f32 = 0.8;
/// Share of values cut at black or white from which on a ground was that: noise that is as often up as down cuts half.
const CUT: f32 = 0.4;
/// A ground is black or white when it is no further off than this.
const CLEAN: f32 = 0.002;
/// From here on a channel of a ground may have been cut at white: compression moves it by a level or two.
pub(in crate::extract) const NEARLY_WHITE: f32 = 0.985;
/// A ground is plain where that share of the border is no further from its colour than this: two levels of 255.
const PLAIN: f32 = 2.5 / 255.0;

/// The picture with its ground made white; as it is where its border is not of one colour, or is white or black already.
pub(in crate::extract) fn on_white(picture: Picture) -> Picture {
    whitened(&picture).unwrap_or(picture)
}

fn whitened(picture: &Picture) -> Option<Picture> {
    colour(picture).map(|ground| whitened_from(picture, ground))
}

/// The picture with all of that colour made white.
pub(in crate::extract) fn whitened_from(picture: &Picture, ground: [f32; 3]) -> Picture {
    replaced(picture, ground, [1.0; 3])
}

/// The picture with its ground made white where that is plain, as no scene is; `None` where it is not, or is white or black.
pub(in crate::extract) fn without_plain(picture: &Picture) -> Option<Picture> {
    let ground = plain(picture)?;
    // Compression makes such of white and black.
    let distances = match is_clean_within(1.0 - NEARLY_WHITE, ground) {
        true => DISTANCE,
        false => DRAWN,
    };
    Some(replaced_within(picture, ground, [1.0; 3], distances))
}

/// The picture with all of a colour made another one.
pub(in crate::extract) fn replaced(picture: &Picture, colour: [f32; 3], by: [f32; 3]) -> Picture {
    replaced_within(picture, colour, by, DISTANCE)
}

fn replaced_within(picture: &Picture, colour: [f32; 3], by: [f32; 3], distances: [f32; 2]) -> Picture {
    let mut pixels = vec![0.0; picture.pixels.len()];
    Instructions::widest().run(Replace {
        pixels: picture.pixels.as_chunks().0,
        colour,
        by,
        distances,
        out: pixels.as_chunks_mut().0,
    });
    Picture { pixels, ..*picture }
}

/// Makes what is of a colour another one.
struct Replace<'a> {
    pixels: &'a [[f32; 3]],
    colour: [f32; 3],
    by: [f32; 3],
    distances: [f32; 2],
    out: &'a mut [[f32; 3]],
}

impl Vectorised for Replace<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (out, pixel) in self.out.iter_mut().zip(self.pixels) {
            let kept = share_of_scene(pixel, self.colour, self.distances);
            for c in 0..3 {
                out[c] = pixel[c] * kept + self.by[c] * (1.0 - kept);
            }
        }
    }
}

/// How much of a pixel is not of a ground of this colour: nothing up to the first distance, all from the second on.
#[inline(always)]
pub(in crate::extract) fn share_of_scene(pixel: &[f32; 3], ground: [f32; 3], [near, far]: [f32; 2]) -> f32 {
    ((distance(pixel, ground) - near) / (far - near)).clamp(0.0, 1.0)
}

/// The colour of the ground; `None` where the border is not of one colour, or is white or black already.
pub(in crate::extract) fn colour(picture: &Picture) -> Option<[f32; 3]> {
    let ground = seen(picture)?;
    let border = border(picture);
    let mut of_ground = border.iter().filter(|pixel| is_near(pixel, ground));
    let clean = of_ground.all(|pixel| is_clean(*pixel));
    (!clean).then_some(ground)
}

/// The colour of a ground that is plain, as no scene is; `None` where there is none, or it is white or black.
fn plain(picture: &Picture) -> Option<[f32; 3]> {
    let ground = colour(picture)?;
    let border = border(picture);
    (within(&border, ground, PLAIN) >= SHARE * border.len() as f32).then_some(ground)
}

/// The colour of the ground, whatever it is; `None` where the border is not of one colour.
pub(in crate::extract) fn seen(picture: &Picture) -> Option<[f32; 3]> {
    let border = border(picture);
    let colour = near_half(&border)?;
    (within(&border, colour, CORE) >= OF_NEAR * within(&border, colour, DISTANCE[0])).then_some(colour)
}

/// The colour that half of the border is near to, which need not be a ground; `None` where there is none.
pub(in crate::extract) fn of_border(picture: &Picture) -> Option<[f32; 3]> {
    near_half(&border(picture))
}

fn near_half(border: &[[f32; 3]]) -> Option<[f32; 3]> {
    let colour = medians(border);
    (!border.is_empty() && within(border, colour, DISTANCE[0]) >= SHARE * border.len() as f32).then_some(colour)
}

/// How many pixels are no further from a colour.
fn within(pixels: &[[f32; 3]], colour: [f32; 3], limit: f32) -> f32 {
    pixels.iter().filter(|pixel| distance(pixel, colour) <= limit).count() as f32
}

/// The colour that a ground had before noise, from the outermost pixels: their median in each channel, but white or black
/// where noise was cut there, of half of the pixels.
pub(in crate::extract) fn before_noise(picture: &Picture) -> [f32; 3] {
    let border = border(picture);
    let median = medians(&border);
    std::array::from_fn(|c| {
        let cut = |level: f32| border.iter().filter(|pixel| pixel[c] == level).count();
        let was = |level: f32| cut(level) as f32 >= CUT * border.len() as f32;
        [0.0, 1.0].into_iter().find(|level| was(*level)).unwrap_or(median[c])
    })
}

fn medians(pixels: &[[f32; 3]]) -> [f32; 3] {
    std::array::from_fn(|c| median(pixels.iter().map(|pixel| pixel[c]).collect()))
}

/// Whether a pixel may be of a ground of this colour.
pub(in crate::extract) fn is_near(pixel: &[f32; 3], ground: [f32; 3]) -> bool {
    distance(pixel, ground) <= DISTANCE[0]
}

/// Whether a colour is black or white.
pub(in crate::extract) fn is_clean(colour: [f32; 3]) -> bool {
    is_clean_within(CLEAN, colour)
}

fn is_clean_within(tolerance: f32, colour: [f32; 3]) -> bool {
    [0.0, 1.0]
        .iter()
        .any(|level| colour.iter().all(|v| (v - level).abs() <= tolerance))
}

/// Whether a channel of a ground is white, or was cut there.
pub(super) fn is_white(value: f32) -> bool {
    value >= 1.0 - CLEAN
}

/// How far a pixel is from a colour.
#[inline(always)]
fn distance(pixel: &[f32; 3], colour: [f32; 3]) -> f32 {
    let [red, green, blue] = [pixel[0] - colour[0], pixel[1] - colour[1], pixel[2] - colour[2]];
    // Of two differences the larger; a maximum that minds NaN takes three times as long.
    let larger = |a: f32, b: f32| if b > a { b } else { a };
    larger(larger(larger(0.0, red.abs()), green.abs()), blue.abs())
}

/// The outermost pixels of a picture.
pub(super) fn border(picture: &Picture) -> Vec<[f32; 3]> {
    outermost(picture.width as usize, picture.pixels.as_chunks().0)
}

/// What a picture that is so wide has at its outermost pixels.
pub(in crate::extract) fn outermost<T: Copy>(width: usize, pixels: &[T]) -> Vec<T> {
    if width == 0 || pixels.len() <= 2 * width {
        return pixels.to_vec();
    }
    let (first, rest) = pixels.split_at(width);
    let (inner, last) = rest.split_at(rest.len() - width);
    let sides = inner.chunks_exact(width).flat_map(|row| [row[0], row[width - 1]]);
    first.iter().copied().chain(sides).chain(last.iter().copied()).collect()
}

fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() {
        return 0.0;
    }
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of varied colours on a ground, with waves of this height on the ground.
    fn disc(ground: f32, waves: f32) -> Picture {
        let side = 32;
        let pixels = (0..side * side).flat_map(|i| {
            let (x, y) = (i % side, i / side);
            let inside = (x as f32 - 15.5).hypot(y as f32 - 15.5) < 10.0;
            let wave = waves * (i as f32 * 1.7).sin();
            match inside {
                true => [0.5, 0.3 + 0.01 * x as f32, 0.2],
                false => [ground + wave; 3],
            }
        });
        Picture {
            width: side,
            height: side,
            pixels: pixels.collect(),
        }
    }

    #[test]
    fn a_ground_with_noise_becomes_white_and_the_scene_stays() {
        let clean = disc(1.0, 0.0);
        for (ground, waves) in [(0.8, 0.0), (0.96, 0.02), (0.02, 0.02)] {
            assert_eq!(whitened(&disc(ground, waves)).unwrap(), clean, "{ground} {waves}");
        }
    }

    #[test]
    fn a_ground_is_plain_where_it_is_of_one_colour_and_no_scene() {
        assert_eq!(plain(&disc(0.2, 0.0)), Some([0.2; 3]));
        // What JPEG at quality 20 makes of white.
        assert!(plain(&disc(253.0 / 255.0, 0.0)).is_some() && plain(&disc(0.5, 0.005)).is_some());
        // A wall has a texture.
        assert!(plain(&disc(0.5, 0.04)).is_none() && colour(&disc(0.5, 0.04)).is_some());
        assert!(plain(&disc(1.0, 0.0)).is_none() && plain(&disc(0.0, 0.0)).is_none());
    }

    #[test]
    fn blurred_surroundings_are_no_ground() {
        // From side to side they change by a third, and all of the border is near to what is in the middle.
        let side = 64;
        let pixels = (0..side * side).flat_map(|i| {
            let across = (i % side) as f32 / side as f32 - 0.5;
            [0.3 + 0.11 * across, 0.35 - 0.1 * across, 0.25]
        });
        let picture = Picture {
            width: side,
            height: side,
            pixels: pixels.collect(),
        };
        assert!(of_border(&picture).is_some() && seen(&picture).is_none());
    }

    #[test]
    fn of_a_dark_ground_no_dark_scene_is_taken() {
        // A disc that is a twentieth brighter than the ground.
        let mut picture = disc(0.2, 0.0);
        for pixel in picture.pixels.as_chunks_mut::<3>().0 {
            if *pixel != [0.2; 3] {
                *pixel = [0.25; 3];
            }
        }
        let white = without_plain(&picture).unwrap();
        let count = |colour: [f32; 3]| {
            white
                .pixels
                .as_chunks()
                .0
                .iter()
                .filter(|pixel| **pixel == colour)
                .count()
        };
        let (kept, of_ground) = (count([0.25; 3]), count([1.0; 3]));
        assert!(kept > 250 && kept + of_ground == 32 * 32, "{kept} {of_ground}");
        // What compression makes of white may be further from it.
        let mut compressed = disc(0.99, 0.0);
        compressed.pixels[3 * 40] = 0.95;
        assert_eq!(without_plain(&compressed).unwrap(), disc(1.0, 0.0));
    }

    #[test]
    fn pictures_without_a_ground_and_clean_grounds_are_left_alone() {
        for level in [0.0, 1.0] {
            assert_eq!(whitened(&disc(level, 0.0)), None);
        }
        assert_eq!(whitened(&disc(0.5, 0.4)), None);
        let none = Picture {
            width: 0,
            height: 0,
            pixels: vec![],
        };
        assert_eq!(whitened(&none), None);
    }
}
