//! White balance: a ground that had been white tells what was done to each channel, up to what lies beyond white. Where
//! there is none, small tints are guessed.
use guardsplat_codeword::tint_without_ground;

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

/// What the channels of a picture were multiplied by, `beyond` those whose ground is white; `None` where nothing was. A
/// picture without a ground that may have been white has a tint, which `beyond` stands for.
pub(super) fn gains(picture: &Picture, beyond: [f32; 3]) -> Option<[f32; 3]> {
    let ground = ground::seen(picture).filter(|ground| ground.iter().all(|v| *v >= BRIGHT));
    let gains = std::array::from_fn(|c| match ground {
        Some(ground) if ground::is_white(ground[c]) => beyond[c],
        Some(ground) => ground[c],
        None => tint_without_ground(beyond[c]),
    });
    (gains != [1.0; 3]).then_some(gains)
}

/// Which channels of a ground that had been white are white still, and may have been cut there; `None` where all are, or
/// where it had hardly been white.
pub(in crate::extract) fn cut(ground: [f32; 3]) -> Option<[bool; 3]> {
    let cut = ground.map(|v| v >= ground::NEARLY_WHITE);
    let bright = ground.iter().all(|v| *v >= BRIGHT);
    (bright && cut != [true; 3]).then_some(cut)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::photometric::ToneChange;

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
        assert_eq!(gains(&on([1.0; 3]), [1.0; 3]), None);
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
        let told = gains(&tinted, [1.0; 3]).unwrap();
        let before = ToneChange::of_gains(told.map(f32::ln)).undone_at_any_rate(&tinted);
        for (a, b) in before.pixels.iter().zip(&scene.pixels) {
            assert!((a - b).abs() < 1e-6);
        }
    }

    #[test]
    fn a_ground_tells_which_channels_may_have_been_cut() {
        assert_eq!(cut([1.0, 0.99, 0.9]), Some([true, true, false]));
        assert_eq!(cut([0.9; 3]), Some([false; 3]));
        assert_eq!([[0.2, 1.0, 1.0], [1.0; 3]].map(cut), [None; 2]);
    }

    #[test]
    fn without_a_ground_that_had_been_white_small_tints_are_guessed() {
        let dark = on([0.2; 3]);
        let near = |beyond: [f32; 3], expected: [f32; 3]| {
            let found = gains(&dark, beyond).unwrap();
            assert!(
                found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6),
                "{found:?}"
            );
        };
        near([1.05, 1.025, 1.0], [1.04, 1.0, 0.96]);
        near([1.0; 3], [0.96; 3]);
        assert_eq!(gains(&dark, [1.025; 3]), None);
        // Tints of 6 % either way are within 2 % of a guess.
        for tint in [0.94, 0.97, 1.0, 1.03, 1.06] {
            let nearest = BEYOND.map(|beyond| (tint_without_ground(beyond) / tint - 1.0).abs());
            assert!(nearest.into_iter().fold(1.0, f32::min) < 0.022, "{tint}");
        }
    }
}
