//! A small picture that reads nearly as a part of a picture does, for the first look at many changes of tones.
//!
//! A tower that averages over small squares does not see where they are. So some of them, put together, are read at a
//! fraction of the cost. Ground adds nothing, and is left out.
use crate::extract::photometric::{ToneChange, ground};
use crate::picture::Picture;

/// Side of a sample, as a share of the picture's: a quarter of its pixels are read.
const SHARE: f32 = 0.5;
/// Fewest squares a side.
const LEAST: usize = 5;

/// Squares of a picture that show the scene.
pub(super) struct Sample {
    squares: Picture,
    /// The colour of the ground that was left out; what of it is mixed into the squares is made white.
    ground: Option<[f32; 3]>,
}

impl Sample {
    /// Squares of `side` pixels from all over a picture; `None` where it has too few.
    pub fn of(picture: &Picture, side: usize) -> Option<Self> {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let ground = ground::seen(picture);
        let row = |x: usize, y: usize| &picture.pixels[3 * (y * width + x)..][..3 * side];
        let corners = (0..height / side).flat_map(|y| (0..width / side).map(move |x| (x * side, y * side)));
        let scene: Vec<(usize, usize)> = corners
            .filter(|(x, y)| {
                let mut pixels = (0..side).flat_map(|dy| row(*x, y + dy).as_chunks::<3>().0);
                ground.is_none_or(|ground| pixels.any(|pixel| !ground::is_near(pixel, ground)))
            })
            .collect();
        let most = (SHARE * width.min(height) as f32 / side as f32) as usize;
        let count = most.min(scene.len().isqrt());
        if count < LEAST {
            return None;
        }
        let chosen: Vec<_> = (0..count * count)
            .map(|i| scene[i * scene.len() / (count * count)])
            .collect();
        let rows = chosen
            .chunks(count)
            .flat_map(|line| (0..side).map(move |dy| (line, dy)));
        let pixels = rows.flat_map(|(line, dy)| line.iter().flat_map(move |(x, y)| row(*x, y + dy)));
        Some(Self {
            squares: Picture {
                width: (count * side) as u32,
                height: (count * side) as u32,
                pixels: pixels.copied().collect(),
            },
            ground,
        })
    }

    /// The squares before a change, with what they show of a ground made white; `None` where it can't have been.
    pub fn undone(&self, change: &ToneChange, whole: &Picture) -> Option<Picture> {
        let squares = change.undone(&self.squares, whole)?;
        let Some(ground) = self.ground else {
            return Some(squares);
        };
        let pixel = Picture {
            width: 1,
            height: 1,
            pixels: ground.to_vec(),
        };
        let ground = change.undone(&pixel, whole)?.pixels.as_chunks::<3>().0[0];
        Some(match ground::is_clean(ground) {
            true => squares,
            false => ground::whitened_from(&squares, ground),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square picture with these pixels.
    fn square(side: usize, pixel: impl Fn(usize) -> [f32; 3]) -> Picture {
        Picture {
            width: side as u32,
            height: side as u32,
            pixels: (0..side * side).flat_map(pixel).collect(),
        }
    }

    #[test]
    fn squares_are_whole_and_of_the_scene() {
        // A scene whose pixels tell their places, on white.
        let side = 160_usize;
        let pixel = |i: usize| {
            let (x, y) = (i % side, i / side);
            match x >= 40 && y >= 80 {
                true => [x as f32 / 200.0, y as f32 / 200.0, 0.3],
                false => [1.0; 3],
            }
        };
        let picture = square(side, pixel);
        let sample = Sample::of(&picture, 4).unwrap();
        assert_eq!((sample.squares.width, sample.ground), (80, Some([1.0; 3])));
        let pixels = sample.squares.pixels.as_chunks::<3>().0;
        assert!(pixels.iter().all(|p| p[2] == 0.3));
        for square in 0..400 {
            let at = |dx: usize, dy: usize| pixels[(square / 20 * 4 + dy) * 80 + square % 20 * 4 + dx];
            assert!((at(3, 3)[0] - at(0, 0)[0] - 0.015).abs() < 1e-6, "{square}");
            assert!((at(3, 3)[1] - at(0, 0)[1] - 0.015).abs() < 1e-6, "{square}");
        }
        let plain = Picture {
            pixels: vec![1.0; picture.pixels.len()],
            ..picture
        };
        assert!(Sample::of(&plain, 4).is_none());
    }

    #[test]
    fn a_ground_that_would_have_been_brighter_than_white_is_impossible() {
        let side = 40_usize;
        let pixel = |i: usize| match i % side > 4 && i % side < 36 && i / side > 4 && i / side < 36 {
            true => [0.2; 3],
            false => [0.8; 3],
        };
        let picture = square(side, pixel);
        let sample = Sample::of(&picture, 4).unwrap();
        let darker = |factor: f32| sample.undone(&ToneChange::of_gains([factor.ln(); 3]), &picture);
        assert!(darker(0.8).is_some() && darker(0.7).is_none());
    }
}
