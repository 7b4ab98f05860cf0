//! Builds a [`Projection`] from features of natural pictures and of messages.
//!
//! All pictures sit in one corner of CLIP's space and all texts in another, and features of a scene change from view
//! to view more than a mark can move them. So: centre each tower by its own mean, drop the directions in which natural
//! pictures vary most, bring both towers to the same spread (texts alike in all directions), and keep what natural variation is left as the noise that
//! the decoder must learn to stand.
use super::eigen;
use super::matrix::{congruence, dot, product};
use super::projection::{MAX_WIDTH, Projection};
use crate::error::{Error, Result};

/// Smallest variance of features that is believed, against the largest.
const SMALLEST_VARIANCE: f64 = 1e-4;

/// How to build a projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FitOptions {
    /// How many of the strongest directions of natural variation to drop.
    pub remove: usize,
    /// Dimensions to keep: those of the rest along which texts vary most. `None` keeps all.
    pub keep: Option<usize>,
    /// Features are ranked: a mark moves the first dimensions most, against how much they vary by themselves, and so on
    /// down, and they vary alike. Then nothing is removed and the first `keep` are kept as they are: a covariance of a few
    /// pictures to whiten by would do more harm than good.
    pub ranked: bool,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            remove: 64,
            keep: None,
            ranked: false,
        }
    }
}

/// Fits a projection to image features of unmarked pictures `[n][width]` and text features `[m][width]`, both
/// L2-normalised.
///
/// # Errors
/// Fewer than two rows, numbers that are not finite, more directions to drop or keep than there are, or features
/// without any variation in what is kept.
pub fn fit(images: &[f32], texts: &[f32], width: usize, options: FitOptions) -> Result<Projection> {
    let bad = |field, reason| Err(Error::BadOption { field, reason });
    if width == 0 || width > MAX_WIDTH {
        return bad("width", format!("{width} is outside 1 to {MAX_WIDTH}"));
    }
    let remove = if options.ranked { 0 } else { options.remove };
    if remove >= width {
        return bad("remove", format!("{remove} directions leave nothing of {width}"));
    }
    let rest = width - remove;
    let rank = options.keep.unwrap_or(rest);
    if rank == 0 || rank > rest {
        return bad("keep", format!("{rank} is outside 1 to {rest}"));
    }
    let (mean_image, image) = covariance("image features", images, width)?;
    let (mean_text, text) = covariance("text features", texts, width)?;
    let samples = images.len() / width;
    if samples <= remove + 1 {
        return bad("remove", format!("{samples} pictures do not show {remove} directions"));
    }

    let basis = match options.ranked {
        true => first_axes(rank, width),
        false => strongest_texts(&image, &text, width, remove, rank)?,
    };
    let (image, text) = (congruence(&basis, &image, width), congruence(&basis, &text, width));
    let to_image = scaled_identity(unit_spread("image", &image, rank)?, rank);
    let to_text = whitener("text", &text, rank)?;
    Ok(Projection {
        width,
        rank,
        mean_image: mean_image.iter().map(|&v| v as f32).collect(),
        mean_text: mean_text.iter().map(|&v| v as f32).collect(),
        matrix_image: transposed(&product(&to_image, &basis, rank, width), width),
        matrix_text: transposed(&product(&to_text, &basis, rank, width), width),
        noise: cholesky(congruence(&to_image, &image, rank), rank),
    })
}

/// The first `rank` axes, `[rank][width]`.
fn first_axes(rank: usize, width: usize) -> Vec<f64> {
    (0..rank * width)
        .map(|i| f64::from(u8::from(i / width == i % width)))
        .collect()
}

/// Without the `remove` directions in which natural pictures vary most, the `rank` ones along which texts vary most,
/// `[rank][width]`, orthonormal rows.
fn strongest_texts(image: &[f64], text: &[f64], width: usize, remove: usize, rank: usize) -> Result<Vec<f64>> {
    let rest = width - remove;
    let natural = decompose(image.to_vec(), width)?;
    let basis = natural[remove * width..].to_vec();
    if rank == rest {
        return Ok(basis);
    }
    let turn = decompose(congruence(&basis, text, width), rest)?;
    Ok(product(&turn[..rank * rest], &basis, rest, width))
}

fn scaled_identity(scale: f64, n: usize) -> Vec<f64> {
    (0..n * n).map(|i| if i / n == i % n { scale } else { 0.0 }).collect()
}

/// Mean and covariance (`width` x `width`) of feature rows.
fn covariance(what: &'static str, rows: &[f32], width: usize) -> Result<(Vec<f64>, Vec<f64>)> {
    let bad = |reason| Err(Error::BadOption { field: what, reason });
    let n = rows.len() / width;
    if n < 2 || n * width != rows.len() {
        return bad(format!("{} numbers are not two or more rows of {width}", rows.len()));
    }
    if let Some(at) = rows.iter().position(|v| !v.is_finite()) {
        return bad(format!("row {} holds {}", at / width, rows[at]));
    }
    let mut mean = vec![0.0; width];
    for row in rows.chunks_exact(width) {
        mean.iter_mut()
            .zip(row)
            .for_each(|(m, &v)| *m += f64::from(v) / n as f64);
    }
    let mut sum = vec![0.0; width * width];
    let mut centred = vec![0.0; width];
    for row in rows.chunks_exact(width) {
        centred
            .iter_mut()
            .zip(row.iter().zip(&mean))
            .for_each(|(c, (&v, m))| *c = f64::from(v) - m);
        for i in 0..width {
            let scale = centred[i] / (n - 1) as f64;
            sum[i * width + i..(i + 1) * width]
                .iter_mut()
                .zip(&centred[i..])
                .for_each(|(s, c)| *s += scale * c);
        }
    }
    for i in 0..width {
        for j in 0..i {
            sum[i * width + j] = sum[j * width + i];
        }
    }
    Ok((mean, sum))
}

fn no_directions() -> Error {
    Error::BadOption {
        field: "features",
        reason: "their covariance has no principal directions".into(),
    }
}

/// The symmetric matrix that gives features of this covariance the same variance in every direction, and unit spread.
/// Messages of one key fill a few directions only; natural variation would hide what the others tell.
fn whitener(what: &str, covariance: &[f64], n: usize) -> Result<Vec<f64>> {
    unit_spread(what, covariance, n)?;
    let eigen = eigen::symmetric(covariance.to_vec(), n).ok_or_else(no_directions)?;
    let floor = eigen.values[0] * SMALLEST_VARIANCE;
    let mut out = vec![0.0; n * n];
    for (row, value) in eigen.vectors.chunks_exact(n).zip(&eigen.values) {
        let factor = 1.0 / value.max(floor).sqrt();
        for (i, out) in out.chunks_exact_mut(n).enumerate() {
            out.iter_mut().zip(row).for_each(|(o, v)| *o += factor * row[i] * v);
        }
    }
    // Directions under the floor are not brought up to the others: scale to unit spread all the same.
    let spread = unit_spread(what, &congruence(&out, covariance, n), n)?;
    out.iter_mut().for_each(|v| *v *= spread);
    Ok(out)
}

fn decompose(matrix: Vec<f64>, n: usize) -> Result<Vec<f64>> {
    let eigen = eigen::symmetric(matrix, n).ok_or_else(no_directions)?;
    debug_assert!(eigen.values.len() == n);
    Ok(eigen.vectors)
}

/// The factor that gives a covariance a mean variance of 1 a dimension.
fn unit_spread(what: &str, covariance: &[f64], n: usize) -> Result<f64> {
    let trace: f64 = (0..n).map(|i| covariance[i * n + i]).sum();
    // Features are of unit length in f32: less variance than this is rounding.
    if trace / n as f64 <= 1e-12 {
        let reason = format!("{what} features do not vary in the {n} dimensions that are kept");
        return Err(Error::BadOption {
            field: "features",
            reason,
        });
    }
    Ok((n as f64 / trace).sqrt())
}

/// `B^T` as f32: columns are the rows of B.
fn transposed(basis: &[f64], width: usize) -> Vec<f32> {
    (0..width)
        .flat_map(|i| basis.iter().skip(i).step_by(width).map(|v| *v as f32))
        .collect()
}

/// Lower factor F with `F F^T` = C for a covariance that may be of lower rank: pivots at rounding level become zero.
fn cholesky(mut c: Vec<f64>, n: usize) -> Vec<f32> {
    let negligible = 1e-10 * (0..n).map(|i| c[i * n + i]).fold(0.0, f64::max);
    for j in 0..n {
        let (done, below) = c.split_at_mut((j + 1) * n);
        let row = &mut done[j * n..];
        let pivot = row[j] - dot(&row[..j], &row[..j]);
        row[j] = if pivot > negligible { pivot.sqrt() } else { 0.0 };
        row[j + 1..].fill(0.0);
        for other in below.chunks_exact_mut(n) {
            let value = other[j] - dot(&other[..j], &row[..j]);
            other[j] = if row[j] > 0.0 { value / row[j] } else { 0.0 };
        }
    }
    c.iter().map(|&v| v as f32).collect()
}

#[cfg(test)]
mod tests;
