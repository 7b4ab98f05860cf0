//! A static background: what several pictures of one size show alike at the same place, as a photograph behind an object that
//! is turned, or the page around a viewer. Background subtraction, as in video.
//!
//! Each picture sees the scene from another side, so that what stays all around is none of it. It must go: a background has logits of its
//! own, in which pictures agree as if they had a mark. Pictures from nearly one side, of which most stays, tell nothing.
use super::smooth_ground::SmoothGround;
use crate::extract::photometric::ground;
use crate::picture::Picture;

/// Pictures that others are compared with, at most, and their pixels.
const COMPARED: usize = 6;
const LARGEST: usize = 1 << 22;
/// Half the side of the squares whose mean difference is looked at.
const RADIUS: usize = 1;
/// Levels of 255 that what stays differs by at most: in the mean of a square, and at a pixel.
const MEAN: u32 = 8;
const MOST: u8 = 24;
/// Share of a picture that must not stay, or the other one shows the same.
const MOVES: f64 = 0.08;
/// Share of the outermost pixels that must be no ground; and of these, share that must stay. What is behind a scene reaches the
/// border, while colours of a scene that two views happen to have at one place do not stay all around it.
const BORDER: f64 = 0.05;
const STAYS: f64 = 0.8;

/// Pictures of one suspect, by their places among all of it.
#[derive(Clone, Debug, Default)]
pub struct StaticBackground {
    compared: Vec<(usize, Levels)>,
}

/// A picture in 8 bits a channel.
#[derive(Clone, Debug)]
struct Levels {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl StaticBackground {
    /// Which of so many pictures others are to be compared with: a few from all over, and none of one alone.
    pub fn places(count: usize) -> impl Iterator<Item = usize> {
        let compared = if count > 1 { count.min(COMPARED) } else { 0 };
        (0..compared).map(move |i| i * count / compared)
    }

    /// Takes in the picture at that place.
    pub fn add(&mut self, place: usize, picture: &Picture) {
        if picture.pixels.len() <= 3 * LARGEST {
            self.compared.push((place, Levels::of(picture)));
        }
    }

    /// The picture at that place with what stays in the colour of its ground, or black where it shows none; `None` where
    /// hardly anything stays but a ground, plain or [smooth](super::smooth_ground), which is taken out elsewhere and tells of
    /// tones.
    pub fn taken_out(&self, place: usize, picture: &Picture) -> Option<Picture> {
        let others: Vec<&Levels> = self
            .compared
            .iter()
            .filter(|(other, levels)| *other != place && levels.is_as_large_as(picture))
            .map(|(_, levels)| levels)
            .collect();
        if others.is_empty() || SmoothGround::seen(picture).is_some() {
            return None;
        }
        let levels = Levels::of(picture);
        let mut stays = vec![false; levels.pixels.len()];
        for alike in others.into_iter().map(|other| levels.alike(other)) {
            if share(&alike) <= 1.0 - MOVES {
                stays.iter_mut().zip(alike).for_each(|(stays, alike)| *stays |= alike);
            }
        }
        let pixels = picture.pixels.as_chunks::<3>().0;
        let seen = ground::seen(picture);
        let is_ground = |pixel: &[f32; 3]| seen.is_some_and(|ground| ground::is_near(pixel, ground));
        for (stays, pixel) in stays.iter_mut().zip(pixels) {
            *stays &= !is_ground(pixel);
        }
        let border = ground::outermost(levels.width, pixels).into_iter();
        let border: Vec<_> = border.zip(ground::outermost(levels.width, &stays)).collect();
        let behind = border.iter().filter(|(pixel, _)| !is_ground(pixel));
        let behind: Vec<bool> = behind.map(|(_, stays)| *stays).collect();
        let reaches_border = behind.len() as f64 >= BORDER * border.len() as f64 && share(&behind) >= STAYS;
        let by = seen.unwrap_or([0.0; 3]);
        let out = pixels.iter().zip(&stays);
        reaches_border.then(|| Picture {
            pixels: out
                .flat_map(|(pixel, stays)| if *stays { by } else { *pixel })
                .collect(),
            ..*picture
        })
    }
}

fn share(mask: &[bool]) -> f64 {
    mask.iter().filter(|is| **is).count() as f64 / mask.len().max(1) as f64
}

impl Levels {
    fn of(picture: &Picture) -> Self {
        let level = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        Self {
            width: picture.width as usize,
            pixels: picture
                .pixels
                .as_chunks()
                .0
                .iter()
                .map(|pixel: &[f32; 3]| pixel.map(level))
                .collect(),
        }
    }

    fn is_as_large_as(&self, picture: &Picture) -> bool {
        (self.width, 3 * self.pixels.len()) == (picture.width as usize, picture.pixels.len())
    }

    /// Where two pictures of one size show the same.
    fn alike(&self, other: &Self) -> Vec<bool> {
        let differences: Vec<u8> = self
            .pixels
            .iter()
            .zip(&other.pixels)
            .map(|(a, b)| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0))
            .collect();
        let mut sums = vec![0_u32; differences.len()];
        let mut counts = vec![0_u32; differences.len()];
        // Along rows, then along columns.
        let width = self.width.max(1);
        for (row, sums) in differences.chunks(width).zip(sums.chunks_mut(width)) {
            running(row.iter().map(|v| u32::from(*v)), sums.iter_mut());
        }
        let height = differences.len() / width;
        let mut column = vec![0_u32; height];
        for x in 0..self.width {
            let cells = || (0..height).map(move |y| y * self.width + x);
            running(cells().map(|i| sums[i]), column.iter_mut());
            cells().zip(&column).for_each(|(i, sum)| counts[i] = *sum);
        }
        let within = |length: usize, i: usize| (i + RADIUS + 1).min(length) - i.saturating_sub(RADIUS);
        let is_alike = |(i, (sum, most)): (usize, (&u32, &u8))| {
            let area = within(self.width, i % self.width) * within(height, i / self.width);
            *most <= MOST && *sum <= MEAN * area as u32
        };
        counts.iter().zip(&differences).enumerate().map(is_alike).collect()
    }
}

/// Sums over windows of a line, cut off at its ends.
fn running<'a>(line: impl ExactSizeIterator<Item = u32> + Clone, out: impl Iterator<Item = &'a mut u32>) {
    let length = line.len();
    let mut ahead = line.clone();
    let mut behind = line;
    let mut sum: u32 = ahead.by_ref().take(RADIUS).sum();
    for (i, out) in out.enumerate().take(length) {
        sum += ahead.next().unwrap_or(0);
        if i > RADIUS {
            sum -= behind.next().unwrap_or(0);
        }
        *out = sum;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disc of varied colours at a place before a photograph.
    fn shown(side: u32, at: [f32; 2], backdrop: impl Fn(f32, f32) -> [f32; 3]) -> Picture {
        let pixels = (0..side * side).flat_map(|i| {
            let (x, y) = ((i % side) as f32 / side as f32, (i / side) as f32 / side as f32);
            match is_disc(at, x, y) {
                true => [0.3 + x - at[0], 0.7 + at[1] - y, 0.2 + 0.5 * at[0]],
                false => backdrop(x, y),
            }
        });
        Picture {
            width: side,
            height: side,
            pixels: pixels.collect(),
        }
    }

    fn is_disc(at: [f32; 2], x: f32, y: f32) -> bool {
        (x - at[0]).hypot(y - at[1]) < 0.2
    }

    fn photograph(x: f32, y: f32) -> [f32; 3] {
        [
            0.4 + 0.3 * (9.0 * x).sin(),
            0.5 + 0.4 * (7.0 * y).cos(),
            0.4 + 0.3 * (11.0 * x * y).sin(),
        ]
    }

    fn background(pictures: &[Picture]) -> StaticBackground {
        let mut background = StaticBackground::default();
        for place in StaticBackground::places(pictures.len()) {
            background.add(place, &pictures[place]);
        }
        background
    }

    /// White below a bar of many colours.
    fn page(x: f32, y: f32) -> [f32; 3] {
        match y < 0.2 {
            true => [0.2 + 0.3 * x, 0.3, 0.5],
            false => [1.0; 3],
        }
    }

    #[test]
    fn photographs_and_pages_go_and_what_moves_stays() {
        let places = [[0.3, 0.5], [0.5, 0.6], [0.6, 0.5]];
        for (is_page, by) in [(false, [0.0; 3]), (true, [1.0; 3])] {
            let pictures = places.map(|at| shown(200, at, if is_page { page } else { photograph }));
            let background = background(&pictures);
            for (place, (at, picture)) in places.into_iter().zip(&pictures).enumerate() {
                let out = background.taken_out(place, picture).unwrap();
                let pixels = out.pixels.as_chunks::<3>().0.iter().zip(picture.pixels.as_chunks().0);
                for (i, (after, before)) in pixels.enumerate() {
                    let (x, y) = ((i % 200) as f32 / 200.0, (i / 200) as f32 / 200.0);
                    if is_disc(at, x, y) {
                        assert_eq!(after, before, "{x} {y}");
                    }
                    // Squares at the edge of any disc differ.
                    if places.iter().all(|at| (x - at[0]).hypot(y - at[1]) > 0.22) {
                        assert_eq!(*after, by, "{x} {y}");
                    }
                }
            }
        }
    }

    #[test]
    fn where_nothing_or_all_or_white_alone_stays_nothing_is_taken_out() {
        let none = |pictures: &[Picture]| {
            let background = background(pictures);
            pictures
                .iter()
                .enumerate()
                .all(|(place, picture)| background.taken_out(place, picture).is_none())
        };
        let one = shown(200, [0.5, 0.5], photograph);
        assert!(none(std::slice::from_ref(&one)) && none(&[one.clone(), one.clone()]));
        let white = [[0.3, 0.4], [0.6, 0.6]].map(|at| shown(200, at, |_, _| [1.0; 3]));
        assert!(none(&white));
        let elsewhere = shown(200, [0.3, 0.4], |x, y| photograph(y, 1.0 - x));
        assert!(none(&[one.clone(), elsewhere]));
        assert!(none(&[one, shown(100, [0.3, 0.4], photograph)]));
        // A wall that two views of a room have at one place, and a scene of one colour before white.
        let wall = |moved: f32, around: fn(f32, f32) -> [f32; 3]| {
            shown(200, [2.0; 2], |x, y| {
                match is_disc([0.5; 2], x / 2.0 + 0.25, y / 2.0 + 0.25) {
                    true => [0.6, 0.5, 0.4],
                    false => around(x + moved, y - moved),
                }
            })
        };
        assert!(none(&[wall(0.0, photograph), wall(0.4, photograph)]));
        assert!(none(&[
            wall(0.0, |_, _| [1.0; 3]),
            shown(200, [0.5; 2], |_, _| [1.0; 3])
        ]));
        let empty = Picture {
            width: 0,
            height: 0,
            pixels: Vec::new(),
        };
        assert!(none(&[empty.clone(), empty]));
    }

    #[test]
    fn a_few_pictures_are_compared_from_all_over() {
        let places = |count: usize| StaticBackground::places(count).collect::<Vec<_>>();
        assert_eq!((places(0), places(1)), (Vec::new(), Vec::new()));
        assert_eq!(places(3), [0, 1, 2]);
        assert_eq!(places(60), [0, 10, 20, 30, 40, 50]);
    }

    #[test]
    fn windows_are_cut_off_at_the_ends() {
        let line: Vec<u32> = (1..=12).collect();
        let mut sums = [0; 12];
        running(line.iter().copied(), sums.iter_mut());
        let expected = |i: usize| {
            line[i.saturating_sub(RADIUS)..(i + RADIUS + 1).min(12)]
                .iter()
                .sum::<u32>()
        };
        assert!(sums.iter().enumerate().all(|(i, sum)| *sum == expected(i)));
    }
}
