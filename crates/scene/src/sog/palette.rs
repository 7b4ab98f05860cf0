//! Higher bands: rows of coefficients that Gaussians share, and which row each has.
use super::meta::Rest;
use super::picture::Picture;
use crate::ignored::RowFilter;

/// Rows of the palette side by side in its picture.
pub(crate) const SIDE_BY_SIDE: usize = 64;

/// The palette and each Gaussian's place in it, without bands that nobody uses.
#[derive(Debug)]
pub(super) struct Palette {
    degree: usize,
    /// Row of each Gaussian.
    labels: Vec<u16>,
    /// Coefficients a row, RGB innermost, from the first band on.
    values: Vec<f32>,
}

impl Palette {
    /// Decodes the palette for the first `count` pixels of `labels`; `None` where they have nothing but zeros.
    pub fn decode(
        rest: &Rest,
        labels: &Picture,
        centroids: &Picture,
        count: usize,
        sieve: &mut RowFilter,
    ) -> Result<Option<Palette>, String> {
        let (bands, rows) = layout(rest, centroids)?;
        let stored = coefficients(bands);
        let mut used = vec![false; rows];
        let label = |i| {
            let [low, high, ..] = labels.texel(i);
            let label = u16::from_le_bytes([low, high]);
            match used.get_mut(usize::from(label)) {
                Some(used) => *used = true,
                None => {
                    let reason = || format!("row {i} of shN_labels is {label}, and the palette has {rows} rows");
                    // A row that is sorted out has no place in the palette; the first does no harm.
                    return sieve.reject(i, reason).map(|()| 0);
                }
            }
            Ok(label)
        };
        let labels = (0..count).map(label).collect::<Result<Vec<u16>, String>>()?;
        let mut values = vec![0.0; rows * 3 * stored];
        let mut degree = 0;
        // Rows of the palette with an index that stands for no number, and that index.
        let mut bad: Vec<Option<u8>> = vec![None; rows];
        for row in (0..rows).filter(|row| used[*row]) {
            // Rows are side by side, so their pixels follow each other whatever the width.
            for place in 0..stored {
                let texel = centroids.texel(row * stored + place);
                for channel in 0..3 {
                    let value = rest.values.value(texel[channel]);
                    if value.is_nan() {
                        bad[row] = bad[row].or(Some(texel[channel]));
                        continue;
                    }
                    if value != 0.0 {
                        degree = degree.max((place + 1).isqrt());
                    }
                    values[3 * (row * stored + place) + channel] = value;
                }
            }
        }
        for (i, label) in labels.iter().enumerate() {
            let row = usize::from(*label);
            if let Some(index) = bad.get(row).copied().flatten() {
                sieve.reject(i, || {
                    format!(
                        "row {i} has row {row} of the palette, which has index {index}, which shN.codebook has no \
                         number for"
                    )
                })?;
            }
        }
        let kept = 3 * coefficients(degree);
        for row in 0..rows {
            let start = row * 3 * stored;
            values.copy_within(start..start + kept, row * kept);
        }
        values.truncate(rows * kept);
        Ok((degree > 0).then_some(Palette { degree, labels, values }))
    }

    /// The highest band in use.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Coefficients of Gaussian `i` from the first band on, laid out as in a row of [`crate::Sh`].
    pub fn row(&self, i: usize) -> &[f32] {
        let stored = 3 * coefficients(self.degree);
        let start = usize::from(self.labels[i]) * stored;
        &self.values[start..start + stored]
    }
}

/// Coefficients of a channel in the bands from 1 to `degree`.
fn coefficients(degree: usize) -> usize {
    (degree + 1) * (degree + 1) - 1
}

/// Number of bands and of rows of the palette; `Err` where the picture has another size.
fn layout(rest: &Rest, centroids: &Picture) -> Result<(usize, usize), String> {
    let (width, height) = (centroids.size().width as usize, centroids.size().height as usize);
    let bands = (1..=3).find(|bands| SIDE_BY_SIDE * coefficients(*bands) == width);
    let bands =
        bands.ok_or_else(|| format!("picture shN_centroids is {width} pixels wide, must be 192, 512 or 960"))?;
    let room = SIDE_BY_SIDE * height;
    match rest.promised {
        None => Ok((bands, room.min(1 << 16))),
        Some((promised, _)) if promised != bands => Err(format!(
            "picture shN_centroids is {width} pixels wide, of {bands} bands, and shN.bands is {promised}"
        )),
        Some((_, rows)) if rows > room => Err(format!(
            "picture shN_centroids has room for {room} rows, and shN.count is {rows}"
        )),
        Some((_, rows)) => Ok((bands, rows)),
    }
}
