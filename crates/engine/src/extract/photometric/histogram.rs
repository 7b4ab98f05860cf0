//! The colours of a picture, how often each is there, and what they were before a change of tones.
//!
//! A tower that reads nothing but how often colours are there reads a few thousand of them as it reads a picture, at a
//! fraction of the cost: neighbours of nearly one colour are one colour that counts more. (Colour signatures, Rubner,
//! Tomasi and Guibas 2000, are the same: clusters with weights.)
use super::ToneChange;
use super::change::OUTSIDE;
use super::ground::{self, DISTANCE};
use super::undo::Undo;
use crate::clip::WeightedColours;
use crate::picture::Picture;
use crate::simd::Instructions;

/// How fine a histogram is: side of its cells in a picture of usual brightness, and how many there are at most; if there are
/// more, cells are made larger.
#[derive(Clone, Copy, Debug)]
pub(in crate::extract) struct Fineness {
    pub cells: f32,
    pub most: usize,
}

impl Fineness {
    /// So fine that it reads nearly as the picture does.
    pub const FINE: Self = Self {
        cells: 1.0 / 96.0,
        most: 6000,
    };
}

/// What the brightest colours of a picture are not darker than as a rule, and of that the least that cells are made smaller to.
const USUAL: f32 = 0.75;
const DARKEST: f32 = 0.25;
/// Steps in which it is told how much of a square is not ground.
const SHARES: f32 = 16.0;

/// Colours of a picture averaged over squares of each of some sides.
pub(in crate::extract) struct ColourHistogram {
    scales: Vec<Scale>,
    ground: Option<Ground>,
}

/// Of squares of one side.
#[derive(Clone, Default)]
struct Scale {
    /// Mean colours of what is not ground.
    colours: Vec<[f32; 3]>,
    /// How much of such a square is not ground.
    shares: Vec<f32>,
    /// How many squares these are.
    counts: Vec<f32>,
    /// The same less what is ground.
    of_scene: Vec<f32>,
}

struct Ground {
    colour: [f32; 3],
    /// The border's pixels that are of it.
    border: Vec<[f32; 3]>,
}

impl ColourHistogram {
    /// Of a picture, averaged over squares of these sides.
    pub fn of(picture: &Picture, sides: &[usize], fineness: Fineness) -> Self {
        let ground = ground::seen(picture).map(|colour| Ground::of(picture, colour));
        let kept = |pixel: &[f32; 3]| {
            let ground = ground.as_ref();
            ground.map_or(1.0, |ground| ground::share_of_scene(pixel, ground.colour, DISTANCE))
        };
        let pixels: Vec<[f32; 4]> = picture
            .pixels
            .as_chunks()
            .0
            .iter()
            .map(|pixel| {
                let kept = kept(pixel);
                [pixel[0] * kept, pixel[1] * kept, pixel[2] * kept, kept]
            })
            .collect();
        // In a picture that was made half as bright, colours lie half as far apart.
        let fineness = Fineness {
            cells: fineness.cells * (brightest(&pixels) / USUAL).clamp(DARKEST, 1.0),
            ..fineness
        };
        let width = picture.width as usize;
        let of_side = |side: &usize| Scale::of(&averaged(&pixels, width, *side), fineness);
        Self {
            scales: sides.iter().map(of_side).collect(),
            ground,
        }
    }

    /// Colours at each scale before a change was done to the picture, with its ground made white where that is not clean then;
    /// `None` where it can't have been done. Contrast was changed about the mean of `whole`.
    pub fn undone(&self, change: &ToneChange, whole: &Picture) -> Option<Vec<WeightedColours>> {
        let (colours, possible) = self.undone_if_possible(change, whole);
        possible.then_some(colours)
    }

    /// The same whether or not that can be; contrast was changed about the mean of `picture`.
    pub fn undone_at_any_rate(&self, change: &ToneChange, picture: &Picture) -> Vec<WeightedColours> {
        self.undone_if_possible(change, picture).0
    }

    fn undone_if_possible(&self, change: &ToneChange, whole: &Picture) -> (Vec<WeightedColours>, bool) {
        let mut possible = true;
        let before = change.before(whole);
        let undone = |colours: &[[f32; 3]], counts: Option<&[f32]>| {
            let mut was = vec![[0.0; 3]; colours.len()];
            let out = was.as_mut_slice();
            let outside = Instructions::widest().run(Undo {
                before,
                pixels: colours,
                counts,
                out,
            });
            (was, outside)
        };
        let ground = self.ground.as_ref().map(|ground| {
            let (was, is_possible) = ground.undone(undone);
            possible &= is_possible;
            was
        });
        let mut scales = Vec::with_capacity(self.scales.len());
        for scale in &self.scales {
            let (mut colours, outside) = undone(&scale.colours, Some(&scale.of_scene));
            possible &= outside <= OUTSIDE * 3.0 * scale.counts.iter().sum::<f32>();
            if let Some(ground) = ground {
                for (colour, share) in colours.iter_mut().zip(&scale.shares) {
                    (0..3).for_each(|c| colour[c] = colour[c] * share + ground[c] * (1.0 - share));
                }
            }
            scales.push(WeightedColours {
                colours,
                counts: scale.counts.clone(),
            });
        }
        (scales, possible)
    }
}

impl Ground {
    fn of(picture: &Picture, colour: [f32; 3]) -> Self {
        let mut border = ground::border(picture);
        border.retain(|pixel| ground::is_near(pixel, colour));
        border.sort_by(|a, b| {
            a.iter()
                .zip(b)
                .fold(std::cmp::Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(b)))
        });
        border.dedup();
        Self { colour, border }
    }

    /// What it had been before a change, or white where that was not clean, and whether it can have been done to it.
    fn undone(&self, undone: impl Fn(&[[f32; 3]], Option<&[f32]>) -> (Vec<[f32; 3]>, f32)) -> ([f32; 3], bool) {
        let (colour, outside) = undone(&[self.colour], None);
        let (border, _) = undone(&self.border, None);
        let clean = border.iter().all(|colour| ground::is_clean(*colour));
        (if clean { colour[0] } else { [1.0; 3] }, outside == 0.0)
    }
}

impl Scale {
    /// Of squares: sums of what is not ground, and how much of them that is.
    fn of(squares: &[[f32; 4]], fineness: Fineness) -> Self {
        let mut cells = fineness.cells;
        loop {
            let scale = Self::in_cells(squares, cells);
            if scale.colours.len() <= fineness.most {
                return scale;
            }
            cells *= 1.25;
        }
    }

    fn in_cells(squares: &[[f32; 4]], cells: f32) -> Self {
        let cell = |square: &[f32; 4]| -> u64 {
            let share = square[3];
            let at = |v: f32| (v / share.max(1e-6) / cells).clamp(0.0, 65535.0) as u64;
            let [red, green, blue] = [0, 1, 2].map(|c| at(square[c]));
            match share > 0.0 {
                true => (((share * SHARES).round() as u64) << 48) | red << 32 | green << 16 | blue,
                false => 0,
            }
        };
        let mut places: Vec<(u64, u32)> = squares
            .iter()
            .zip(0..)
            .map(|(square, place)| (cell(square), place))
            .collect();
        places.sort_unstable();
        let mut scale = Self::default();
        for alike in places.chunk_by(|a, b| a.0 == b.0) {
            let mut sum = [0.0_f32; 4];
            for (_, place) in alike {
                (0..4).for_each(|c| sum[c] += squares[*place as usize][c]);
            }
            let share = sum[3];
            let colour = match share > 0.0 {
                true => [0, 1, 2].map(|c| sum[c] / share),
                false => [0.0; 3],
            };
            scale.colours.push(colour);
            scale.shares.push(share / alike.len() as f32);
            scale.counts.push(alike.len() as f32);
            scale.of_scene.push(share);
        }
        scale
    }
}

/// What nearly all of what is not ground is darker than, in its brightest channel.
fn brightest(pixels: &[[f32; 4]]) -> f32 {
    let scene = pixels.iter().filter(|pixel| pixel[3] == 1.0);
    let mut channels: Vec<f32> = scene.map(|pixel| pixel[0].max(pixel[1]).max(pixel[2])).collect();
    if channels.is_empty() {
        return USUAL;
    }
    let place = (channels.len() - 1) * 98 / 100;
    let (_, brightest, _) = channels.select_nth_unstable_by(place, f32::total_cmp);
    *brightest
}

/// Means over squares of a side; what a last square lacks is left out.
fn averaged(pixels: &[[f32; 4]], width: usize, side: usize) -> Vec<[f32; 4]> {
    if side <= 1 || width < side {
        return pixels.to_vec();
    }
    let columns = width / side;
    let one = 1.0 / (side * side) as f32;
    let rows = pixels.chunks_exact(width * side);
    rows.flat_map(|rows| {
        (0..columns).map(move |column| {
            let mut sum = [0.0; 4];
            for row in rows.chunks_exact(width) {
                for pixel in &row[column * side..][..side] {
                    (0..4).for_each(|c| sum[c] += pixel[c]);
                }
            }
            sum.map(|v| v * one)
        })
    })
    .collect()
}

#[cfg(test)]
mod tests;
