//! One colour channel of a picture, and the mean of what the three channels give.
use super::detector::NoResult;
use image::RgbImage;

/// The samples of one channel in rows.
pub(super) struct Channel {
    /// Samples a row, at least 1.
    pub width: usize,
    /// `[height][width]`.
    pub samples: Vec<u8>,
}

impl Channel {
    /// Red, green and blue; none of a picture without pixels.
    pub fn all(picture: &RgbImage) -> Vec<Channel> {
        let width = picture.width() as usize;
        if picture.as_raw().is_empty() {
            return Vec::new();
        }
        let channel = |channel| Channel {
            width,
            samples: picture.as_raw().iter().skip(channel).step_by(3).copied().collect(),
        };
        (0..3).map(channel).collect()
    }

    /// Its rows.
    pub fn rows(&self) -> impl Iterator<Item = &[u8]> {
        self.samples.chunks_exact(self.width)
    }

    /// Each row with the one below.
    pub fn neighbouring_rows(&self) -> impl Iterator<Item = (&[u8], &[u8])> {
        self.rows().zip(self.rows().skip(1))
    }
}

/// Mean over the channels that give a result, limited to `[0, 1]` after the mean as in StegExpose; the reason of the
/// first channel if none does.
pub(super) fn mean_over_channels(
    picture: &RgbImage,
    detect: impl Fn(&Channel) -> Result<f64, NoResult>,
) -> Result<f64, NoResult> {
    let results: Vec<_> = Channel::all(picture).iter().map(detect).collect();
    let valid: Vec<f64> = results
        .iter()
        .filter_map(|result| result.as_ref().ok().copied())
        .collect();
    if valid.is_empty() {
        let reason = results.into_iter().find_map(Result::err);
        return Err(reason.unwrap_or(NoResult::TooSmall));
    }
    // Adding zero makes one zero of both.
    Ok((0.0 + valid.iter().sum::<f64>() / valid.len() as f64).clamp(0.0, 1.0))
}
