//! From what ranges distortions are drawn.
use serde::{Deserialize, Serialize};

use crate::blur::DEFAULT_SIGMA;
use crate::error::{Result, range_within, within};
use crate::jpeg::Chroma;

/// Limits of what distortions are given, for ranges and for single draws.
pub(crate) mod limits {
    pub const CROP: [f64; 2] = [0.0, 1.0];
    pub const SCALING: [f64; 2] = [0.05, 4.0];
    pub const ROTATION: [f64; 2] = [-180.0, 180.0];
    pub const FACTOR: [f64; 2] = [0.0, 4.0];
    pub const QUALITY: [f64; 2] = [1.0, 100.0];
    pub const NOISE: [f64; 2] = [0.0, 1.0];
    pub const BLUR: [f64; 2] = [0.0, 10.0];
    pub const SHARE: [f64; 2] = [0.0, 1.0];
}

/// Ranges of all distortions of pictures, each from its lowest to its highest value. What is left out in a file has its
/// default.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ranges {
    /// What is left of pictures.
    pub crop: CropRange,
    /// Factors by which pictures are stored smaller or larger, within 0.05 and 4.
    pub scaling: [f32; 2],
    /// Degrees, counter-clockwise, within -180 and 180.
    pub rotation: [f32; 2],
    /// Factors of the colours, within 0 and 4.
    pub brightness: [f32; 2],
    /// Factors of the distance from the mean grey, within 0 and 4.
    pub contrast: [f32; 2],
    /// How pictures are compressed.
    pub jpeg: JpegRange,
    /// Standard deviations of normal noise, within 0 and 1; pictures are in [0, 1].
    pub noise: [f32; 2],
    /// Standard deviations of the window of three pixels, in pixels, within 0 and 10.
    pub blur: [f32; 2],
    /// Shares of the area that rectangles cover, within 0 and 1; less where they overlap.
    pub mask: [f32; 2],
}

/// Windows that are left of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CropRange {
    /// Share of each side that is kept, within 0 and 1.
    pub keep: [f32; 2],
    /// Share of windows that are at the centre, within 0 and 1; the others are anywhere.
    pub centred: f32,
}

/// How pictures are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JpegRange {
    /// Qualities, within 1 and 100.
    pub quality: [u8; 2],
    /// Resolution of the chroma channels.
    pub chroma: Chroma,
    /// Uniform noise instead of rounding.
    pub noise: bool,
}

impl Default for CropRange {
    fn default() -> Self {
        Self {
            keep: [0.4, 0.4],
            centred: 0.5,
        }
    }
}

impl Default for JpegRange {
    fn default() -> Self {
        Self {
            quality: [10, 10],
            chroma: Chroma::Half,
            noise: false,
        }
    }
}

impl Default for Ranges {
    /// Those under which GuardSplat (CVPR 2025) reports its figures; noise is drawn up to the deviation of 0.1 under
    /// which it evaluates, and contrast, of which it reports nothing, as brightness.
    fn default() -> Self {
        Self {
            crop: CropRange::default(),
            scaling: [0.75, 1.25],
            rotation: [-30.0, 30.0],
            brightness: [0.5, 1.5],
            contrast: [0.5, 1.5],
            jpeg: JpegRange::default(),
            noise: [0.0, 0.1],
            blur: [DEFAULT_SIGMA; 2],
            mask: [0.0, 0.2],
        }
    }
}

impl Ranges {
    /// Fails with [`crate::Error::OutOfRange`] or [`crate::Error::Reversed`], with the field, unless all ranges are in
    /// order and within their limits.
    pub fn check(&self) -> Result<()> {
        let quality = self.jpeg.quality.map(f32::from);
        for (field, range, [low, high]) in [
            ("crop.keep", self.crop.keep, limits::CROP),
            ("scaling", self.scaling, limits::SCALING),
            ("rotation", self.rotation, limits::ROTATION),
            ("brightness", self.brightness, limits::FACTOR),
            ("contrast", self.contrast, limits::FACTOR),
            ("jpeg.quality", quality, limits::QUALITY),
            ("noise", self.noise, limits::NOISE),
            ("blur", self.blur, limits::BLUR),
            ("mask", self.mask, limits::SHARE),
        ] {
            range_within(field, range.map(widen), low, high)?;
        }
        let [low, high] = limits::SHARE;
        within("crop.centred", widen(self.crop.centred), low, high)
    }
}

/// The number as it was written, not as a single approximates it, for error messages: six digits are kept.
pub(crate) fn widen(value: f32) -> f64 {
    let value = f64::from(value);
    let rounded = (value * 1e6).round() / 1e6;
    if rounded.is_finite() { rounded } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_change_what_they_name_and_nothing_else() {
        let read: Ranges = serde_json::from_str(r#"{"scaling": [0.5, 1], "jpeg": {"quality": [30, 90]}}"#).unwrap();
        let expected = Ranges {
            scaling: [0.5, 1.0],
            jpeg: JpegRange {
                quality: [30, 90],
                ..JpegRange::default()
            },
            ..Ranges::default()
        };
        assert_eq!(read, expected);
        let text = serde_json::to_string(&read).unwrap();
        assert!(text.contains(r#""chroma":"4:2:0""#), "{text}");
        assert_eq!(serde_json::from_str::<Ranges>(&text).unwrap(), expected);
        for text in [r#"{"zoom": [1, 2]}"#, r#"{"jpeg": {"q": 3}}"#, r#"{"noise": 0.1}"#] {
            assert!(serde_json::from_str::<Ranges>(text).is_err(), "{text}");
        }
    }

    #[test]
    fn limits_are_checked_and_named() {
        Ranges::default().check().unwrap();
        let at_limits = Ranges {
            scaling: [0.05, 4.0],
            mask: [0.0, 1.0],
            ..Ranges::default()
        };
        at_limits.check().unwrap();
        let error = |change: fn(&mut Ranges)| {
            let mut ranges = Ranges::default();
            change(&mut ranges);
            ranges.check().unwrap_err().to_string()
        };
        assert_eq!(
            error(|r| r.scaling = [0.75, 5.0]),
            "scaling is 5, must be within 0.05 and 4"
        );
        assert_eq!(
            error(|r| r.jpeg.quality[0] = 0),
            "jpeg.quality is 0, must be within 1 and 100"
        );
        assert_eq!(
            error(|r| r.rotation = [30.0, -30.0]),
            "rotation goes from 30 to -30, the first must not be above the second"
        );
        assert!(error(|r| r.noise[1] = f32::NAN).starts_with("noise is NaN"));
        assert!(error(|r| r.crop.centred = f32::INFINITY).starts_with("crop.centred is inf"));
    }
}
