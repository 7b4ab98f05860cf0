//! Areas of one plain colour with sharp edges: covers, boxes and bars that somebody drew.
//!
//! An average over a picture hears a plain area more than all of a mark: every pixel says the same. Scenes have smooth
//! areas, too, but those fade into what is beside them.
use crate::extract::photometric::ground;
use crate::picture::Picture;

/// Side in pixels of squares that are looked at first; a plain area has one.
const SQUARE: usize = 8;
/// Levels of 255 by which pixels of a plain area may differ from its colour: compression's.
const TOLERANCE: u8 = 2;
/// Least share of a picture that a plain area covers.
const LEAST: f32 = 0.001;
/// Pixels beyond an edge at which the next colour is looked at, and how many of them are blended.
const BEYOND: isize = 4;
const BLENDED: isize = 2;
/// Levels by which the colour beyond a sharp edge differs at least, and the share of an area's edge that is sharp.
const SHARP: u8 = 12;
const EDGE: f32 = 0.8;

/// The picture with its plain areas made white, which adds nothing to a reading; `None` where it has none. A ground all
/// around stays: it tells what was done to its white.
pub(super) fn without_plain_areas(picture: &Picture) -> Option<Picture> {
    let areas = Areas::of(picture);
    let ground = ground::seen(picture);
    let is_ground = |colour: Pixel| ground.is_some_and(|ground| ground::is_near(&colour.map(unit), ground));
    let least = (LEAST * areas.pixels.len() as f32).max(1.0) as usize;
    let mut seen = vec![false; areas.pixels.len()];
    let mut white = Vec::new();
    for seed in areas.seeds() {
        if seen[seed] {
            continue;
        }
        let area = areas.around(seed, &mut seen);
        let colour = areas.pixels[seed];
        if area.len() >= least && !is_ground(colour) {
            let (edge, rim) = areas.edge(&area, colour);
            if edge >= EDGE {
                white.extend(area.into_iter().chain(rim));
            }
        }
    }
    if white.is_empty() {
        return None;
    }
    let mut pixels = picture.pixels.clone();
    for place in white {
        pixels[3 * place..][..3].fill(1.0);
    }
    Some(Picture { pixels, ..*picture })
}

type Pixel = [u8; 3];

fn unit(level: u8) -> f32 {
    f32::from(level) / 255.0
}

/// Whether two colours differ by more than so many levels.
fn differ(a: Pixel, b: Pixel, levels: u8) -> bool {
    a.iter().zip(b).any(|(a, b)| a.abs_diff(b) > levels)
}

/// A picture in levels, in which areas are looked for.
struct Areas {
    width: usize,
    height: usize,
    pixels: Vec<Pixel>,
}

impl Areas {
    fn of(picture: &Picture) -> Self {
        let pixels = picture.pixels.as_chunks::<3>().0;
        let level = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        Self {
            width: picture.width as usize,
            height: picture.height as usize,
            pixels: pixels.iter().map(|pixel| pixel.map(level)).collect(),
        }
    }

    /// The middle of every square of one colour.
    fn seeds(&self) -> Vec<usize> {
        let squares = (0..self.height / SQUARE).flat_map(|y| (0..self.width / SQUARE).map(move |x| (x, y)));
        let middle = |(x, y): (usize, usize)| {
            let row = |dy: usize| &self.pixels[(y * SQUARE + dy) * self.width + x * SQUARE..][..SQUARE];
            let place = (y * SQUARE + SQUARE / 2) * self.width + x * SQUARE + SQUARE / 2;
            let plain = (0..SQUARE).flat_map(row);
            let mut differing = plain.filter(|pixel| differ(**pixel, self.pixels[place], TOLERANCE));
            differing.next().is_none().then_some(place)
        };
        squares.filter_map(middle).collect()
    }

    /// The pixel so far from another, if there is one.
    fn beside(&self, place: usize, [dx, dy]: [isize; 2]) -> Option<usize> {
        let x = (place % self.width).checked_add_signed(dx)?;
        let y = (place / self.width).checked_add_signed(dy)?;
        (x < self.width && y < self.height).then_some(y * self.width + x)
    }

    /// All pixels of the colour of one that hang together with it, and were not seen before.
    fn around(&self, seed: usize, seen: &mut [bool]) -> Vec<usize> {
        let colour = self.pixels[seed];
        let mut area = vec![seed];
        seen[seed] = true;
        let mut next = 0;
        while next < area.len() {
            for way in WAYS {
                let new = self
                    .beside(area[next], way)
                    .filter(|place| !seen[*place] && !differ(self.pixels[*place], colour, TOLERANCE));
                if let Some(place) = new {
                    seen[place] = true;
                    area.push(place);
                }
            }
            next += 1;
        }
        area
    }

    /// The share of an area's edge within the picture that is sharp, and the pixels beyond it that are blended with it.
    fn edge(&self, area: &[usize], colour: Pixel) -> (f32, Vec<usize>) {
        let (mut sharp, mut all) = (0_usize, 0_usize);
        let mut rim = Vec::new();
        let leaves = |place: &usize| differ(self.pixels[*place], colour, TOLERANCE);
        for place in area {
            for [dx, dy] in WAYS {
                if self.beside(*place, [dx, dy]).filter(leaves).is_none() {
                    continue;
                }
                rim.extend((1..=BLENDED).filter_map(|far| self.beside(*place, [dx * far, dy * far])));
                if let Some(beyond) = self.beside(*place, [dx * BEYOND, dy * BEYOND]) {
                    all += 1;
                    sharp += usize::from(differ(self.pixels[beyond], colour, SHARP));
                }
            }
        }
        (sharp as f32 / all.max(1) as f32, rim)
    }
}

/// To the neighbours of a pixel.
const WAYS: [[isize; 2]; 4] = [[1, 0], [-1, 0], [0, 1], [0, -1]];

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 64;

    /// A picture of these levels.
    fn picture(level: impl Fn(usize, usize) -> [u8; 3]) -> Picture {
        let pixels = (0..SIDE * SIDE).flat_map(|i| level(i % SIDE, i / SIDE).map(unit));
        Picture {
            width: SIDE as u32,
            height: SIDE as u32,
            pixels: pixels.collect(),
        }
    }

    fn rough(x: usize, y: usize) -> [u8; 3] {
        [x * 37, y * 91, x * y * 53].map(|v| (v % 200) as u8)
    }

    #[test]
    fn a_box_becomes_white_with_its_blended_edge_and_nothing_else_does() {
        let within = |x: usize, y: usize| (10..42).contains(&x) && (20..40).contains(&y);
        let noisy = |x: usize, y: usize| [230, 20, 40 + ((x + y) % 2) as u8];
        let before = picture(|x, y| if within(x, y) { noisy(x, y) } else { rough(x, y) });
        let after = without_plain_areas(&before).unwrap();
        for (i, (a, b)) in after
            .pixels
            .as_chunks::<3>()
            .0
            .iter()
            .zip(before.pixels.as_chunks::<3>().0)
            .enumerate()
        {
            let (x, y) = (i % SIDE, i / SIDE);
            if within(x, y) {
                assert_eq!(*a, [1.0; 3], "{x} {y}");
            } else if !(8..44).contains(&x) || !(18..42).contains(&y) {
                assert_eq!(a, b, "{x} {y}");
            }
        }
        assert_eq!(without_plain_areas(&picture(rough)), None);
    }

    #[test]
    fn smooth_scenes_and_grounds_stay() {
        // A plain middle that fades away.
        let faded = picture(|x, y| {
            let far = (x as f32 - 32.0).hypot(y as f32 - 32.0);
            [(200.0 - (far - 12.0).max(0.0)) as u8, 90, 60]
        });
        assert_eq!(without_plain_areas(&faded), None);
        let grounded = picture(|x, y| match (16..48).contains(&x) && (16..48).contains(&y) {
            true => rough(x, y),
            false => [204; 3],
        });
        assert_eq!(without_plain_areas(&grounded), None);
    }

    #[test]
    fn pictures_of_all_sizes_are_taken() {
        for (width, height) in [(0, 0), (1, 1), (7, 300), (300, 7), (9, 9)] {
            let plain = Picture {
                width,
                height,
                pixels: vec![0.4; (width * height * 3) as usize],
            };
            assert_eq!(without_plain_areas(&plain), None);
        }
    }
}
