//! Backdrops: what a viewer shows behind an object where that is not of one colour, as a gradient.
//!
//! It says nothing of the scene, and covers more of a picture than the scene does. But it may also be a white ground in
//! [uneven](super::uneven) light, and only what is read tells which of the two.
use super::smooth_ground::SmoothGround;
use crate::extract::photometric::ground::{DISTANCE, share_of_scene};
use crate::picture::Picture;

/// The picture with its backdrop made black, or white if it is bright: neither adds to a reading, and edges blend into what is
/// nearer to them.
pub(super) fn taken_out(picture: &Picture, ground: &SmoothGround) -> Picture {
    let mean = (0..3).map(|c| ground.darkest[c] + ground.brightest[c]).sum::<f64>() / 6.0;
    let by = if mean > 0.5 { 1.0 } else { 0.0 };
    ground.changed(picture, |pixel, backdrop| {
        let kept = share_of_scene(&pixel, backdrop.map(|v| v as f32), DISTANCE);
        pixel.map(|v| v * kept + by * (1.0 - kept))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc whose colours a backdrop does not have, before one that gets brighter downwards, from `first` by `by`.
    fn disc(side: u32, first: f32, by: f32) -> Picture {
        let pixels = (0..side * side).flat_map(|i| {
            let (x, y) = ((i % side) as f32 / side as f32, (i / side) as f32 / side as f32);
            match (x - 0.5).hypot(y - 0.6) < 0.35 {
                true => [0.9 * x, 0.1, 0.9 - 0.9 * y],
                false => [first + by * y, first + by * y * y, first],
            }
        });
        Picture {
            width: side,
            height: side,
            pixels: pixels.collect(),
        }
    }

    #[test]
    fn a_gradient_goes_and_the_scene_stays() {
        for (first, by, ground) in [(0.1, 0.4, 0.0), (0.6, 0.3, 1.0)] {
            let before = disc(300, first, by);
            let seen = SmoothGround::seen(&before).unwrap();
            let after = taken_out(&before, &seen);
            let pairs = after
                .pixels
                .as_chunks::<3>()
                .0
                .iter()
                .zip(before.pixels.as_chunks::<3>().0);
            for (i, (after, before)) in pairs.enumerate() {
                let (x, y) = ((i % 300) as f32 / 300.0, (i / 300) as f32 / 300.0);
                let of_scene = (x - 0.5).hypot(y - 0.6) < 0.35;
                let expected = if of_scene { *before } else { [ground; 3] };
                assert_eq!(*after, expected, "{first}: {x} {y}");
            }
        }
    }

    #[test]
    fn one_colour_is_no_gradient() {
        assert!(SmoothGround::seen(&disc(300, 0.5, 0.0)).is_none());
    }
}
