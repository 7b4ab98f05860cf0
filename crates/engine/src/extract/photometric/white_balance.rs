//! White balance: a ground that had been white tells what was done to each channel, up to what lies beyond white.
use super::ground;
use crate::picture::Picture;

/// What a channel whose ground is white may have been multiplied by: what came out beyond white was cut.
const BEYOND: [f32; 3] = [1.0, 1.025, 1.05];
/// A ground darker than this had hardly been white.
const BRIGHT: f32 = 0.4;

/// Factors of red, green and blue that are tried where the ground does not tell them.
pub(super) fn all() -> impl Iterator<Item = [f32; 3]> {
    let each = || BEYOND.into_iter();
    each().flat_map(move |red| each().flat_map(move |green| each().map(move |blue| [red, green, blue])))
}

/// What the channels of a picture were multiplied by, `beyond` those whose ground is white; `None` where it shows no ground
/// that may have been white.
pub(super) fn gains(picture: &Picture, beyond: [f32; 3]) -> Option<[f32; 3]> {
    let ground = ground::seen(picture).filter(|ground| ground.iter().all(|v| *v >= BRIGHT))?;
    Some(std::array::from_fn(|c| match ground::is_white(ground[c]) {
        true => beyond[c],
        false => ground[c],
    }))
}

/// The picture before its channels were multiplied by these, values cut to [0, 1].
pub(super) fn undone(gains: [f32; 3], picture: &Picture) -> Picture {
    let pixels = picture.pixels.as_chunks::<3>().0.iter();
    let before = pixels.flat_map(|pixel| std::array::from_fn::<f32, 3, _>(|c| (pixel[c] / gains[c]).clamp(0.0, 1.0)));
    Picture {
        pixels: before.collect(),
        ..*picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Something coloured on a ground.
    fn on(ground: [f32; 3]) -> Picture {
        let side = 16;
        let pixel = |i: usize| match (4..12).contains(&(i % side)) && (4..12).contains(&(i / side)) {
            true => [0.6, 0.4, 0.01 * (i % 7) as f32],
            false => ground,
        };
        Picture {
            width: side as u32,
            height: side as u32,
            pixels: (0..side * side).flat_map(pixel).collect(),
        }
    }

    #[test]
    fn a_ground_tells_what_was_done_and_white_leaves_open_what_is_beyond() {
        assert_eq!(all().count(), 27);
        let beyond = [1.05, 1.025, 1.0];
        assert_eq!(gains(&on([0.9, 0.85, 1.0]), beyond), Some([0.9, 0.85, 1.0]));
        assert_eq!(gains(&on([1.0, 1.0, 0.95]), beyond), Some([1.05, 1.025, 0.95]));
        assert_eq!(gains(&on([0.2; 3]), beyond), None);
        let scene = on([1.0; 3]);
        let tinted = Picture {
            pixels: scene
                .pixels
                .as_chunks::<3>()
                .0
                .iter()
                .flat_map(|p| [p[0] * 0.9, p[1], p[2] * 0.95])
                .collect(),
            ..scene
        };
        let before = undone(gains(&tinted, [1.0; 3]).unwrap(), &tinted);
        for (a, b) in before.pixels.iter().zip(&scene.pixels) {
            assert!((a - b).abs() < 1e-6);
        }
    }
}
