//! How well a small view of the original explains a picture where it is laid over it, by two measures.
use super::common_colours::log_densities;
use super::drawn::Drawn;
use super::observed::Observed;
use crate::error::Result;
use crate::picture::Picture;
use crate::resize::resized;

/// Share of what a view shows that must lie in the picture, and the least of it in pixels.
const INSIDE: f32 = 0.25;
const LEAST: f32 = 6.0;
/// What contrast may have been multiplied by: with none left anything looks like anything.
const CONTRAST: [f32; 2] = [0.4, 2.5];

/// Deviation of a picture's colours from those of the right view at such a size, mostly since no view is quite right.
const DEVIATION: f32 = 0.08;
/// What a pixel says at least and at most for a view: others may be in front of the scene, or have its colour by chance.
const SAYS: [f32; 2] = [-3.0, 5.0];

/// A picture that views are laid over.
pub(super) struct ObservedColours {
    pub observed: Observed,
    /// How common the colour of each pixel is in it.
    log_densities: Vec<f32>,
}

impl ObservedColours {
    /// The picture with its longer side made `side` pixels.
    ///
    /// # Errors
    /// A picture without pixels.
    pub fn of(picture: &Picture, side: u32) -> Result<Self> {
        let observed = Observed::of(picture, side)?;
        Ok(Self {
            log_densities: log_densities(&observed),
            observed,
        })
    }
}

/// A view of the original.
pub(super) struct View {
    /// Pixels a row, and rows.
    pub side: i32,
    /// Red, green and blue over black, and coverage.
    pixels: Vec<[f32; 4]>,
    covered: f32,
}

impl View {
    /// A view that was `drawn` with so many pixels a row and rows, with `side` of them.
    ///
    /// # Errors
    /// A side of none.
    pub fn of(drawn: &Drawn, drawn_side: u32, side: usize) -> Result<Self> {
        let small = |pixels: Vec<f32>| {
            let picture = Picture {
                width: drawn_side,
                height: drawn_side,
                pixels,
            };
            resized(&picture, side, side)
        };
        let colours = small(drawn.colours.as_flattened().to_vec())?;
        let coverage = small(drawn.coverage.iter().flat_map(|coverage| [*coverage; 3]).collect())?;
        let pairs = colours
            .pixels
            .as_chunks::<3>()
            .0
            .iter()
            .zip(coverage.pixels.as_chunks::<3>().0);
        let pixels: Vec<[f32; 4]> = pairs.map(|(c, coverage)| [c[0], c[1], c[2], coverage[0]]).collect();
        Ok(Self {
            side: side as i32,
            covered: pixels.iter().map(|pixel| pixel[3]).sum(),
            pixels,
        })
    }

    /// How well the view explains the picture with its upper left corner here: before a ground of one colour by what is left
    /// of the picture, before anything else by correlation, whatever was done to the tones, and by likelihood. `None` where
    /// too little of it is inside.
    pub fn scores(&self, seen: &ObservedColours, [left, top]: [i32; 2]) -> [Option<f32>; 2] {
        let observed = &seen.observed;
        let (width, height) = (observed.width as i32, observed.height as i32);
        let (columns, rows) = (
            (-left).max(0)..self.side.min(width - left),
            (-top).max(0)..self.side.min(height - top),
        );
        let triples = rows.flat_map(|row| {
            let view = &self.pixels[(row * self.side + columns.start) as usize..][..columns.len()];
            let from = ((row + top) * width + columns.start + left) as usize..;
            view.iter()
                .zip(&observed.pixels[from.clone()])
                .zip(&seen.log_densities[from])
        });
        let least = (INSIDE * self.covered).max(LEAST);
        match observed.ground {
            Some(ground) => [over_ground(triples.map(|(pair, _)| pair), ground, least), None],
            None => over_anything(triples, least),
        }
    }
}

/// How much smaller the squared differences from the picture are with the view than with the ground alone.
fn over_ground<'a>(
    pairs: impl Iterator<Item = (&'a [f32; 4], &'a [f32; 3])>,
    ground: [f32; 3],
    least: f32,
) -> Option<f32> {
    let (mut covered, mut gained) = (0.0, 0.0);
    for (view, seen) in pairs {
        covered += view[3];
        for k in 0..3 {
            let shown = view[k] + (1.0 - view[3]) * ground[k];
            gained += (seen[k] - ground[k]).powi(2) - (seen[k] - shown).powi(2);
        }
    }
    (covered >= least).then_some(gained)
}

/// How much of the variance under the view it explains, where each channel may be brighter and of more contrast: by the
/// square root of the pixels times the logarithm of all over what is left.
///
/// And how much likelier the view makes the picture's colours than any part of the picture would: the sum over pixels of
/// log N(seen; view, DEVIATION) less the logarithm of how common that colour is.
fn over_anything<'a>(
    triples: impl Iterator<Item = ((&'a [f32; 4], &'a [f32; 3]), &'a f32)>,
    least: f32,
) -> [Option<f32>; 2] {
    // Weights, and sums over them of the view, its squares, the picture, its squares, and products.
    let (mut count, mut sums) = (0.0, [[0.0_f32; 3]; 5]);
    let mut likelihood = 0.0;
    let constant = -3.0 * (DEVIATION * std::f32::consts::TAU.sqrt()).ln();
    for ((view, seen), log_density) in triples.filter(|((view, _), _)| view[3] > 0.5) {
        count += view[3];
        let mut squares = 0.0;
        for k in 0..3 {
            let (shown, seen) = (view[k] / view[3], seen[k]);
            squares += (seen - shown).powi(2);
            let terms = [shown, shown * shown, seen, seen * seen, shown * seen];
            sums.iter_mut()
                .zip(terms)
                .for_each(|(sum, term)| sum[k] += view[3] * term);
        }
        let says = constant - squares / (2.0 * DEVIATION * DEVIATION) - log_density;
        likelihood += view[3] * says.clamp(SAYS[0], SAYS[1]);
    }
    if count < least {
        return [None; 2];
    }
    let (mut all, mut left) = (0.0, 0.0);
    for k in 0..3 {
        let [shown, shown_squares, seen, seen_squares, products] = sums.map(|sum| sum[k]);
        let variance = seen_squares - seen * seen / count;
        let of_view = shown_squares - shown * shown / count;
        let common = products - shown * seen / count;
        let contrast = (common / of_view.max(1e-6)).clamp(CONTRAST[0], CONTRAST[1]);
        all += variance;
        left += variance - 2.0 * contrast * common + contrast * contrast * of_view;
    }
    let correlation = (all > 1e-6 && left > 0.0).then(|| count.sqrt() * (all / left).ln());
    [correlation, Some(likelihood)]
}
