//! Every attack with its name, unit and limits.
use super::limits::{Grid, Limits, limits, real};

/// What an attack does. The docs give the meaning of its strength; [`AttackKind::limits`] what it may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AttackKind {
    /// Written as baseline JPEG of this quality (of libjpeg's scale and tables) and read again. Chroma has half the
    /// resolution (4:2:0) at every quality, as libjpeg and OpenCV write it.
    Jpeg,
    /// Written as lossy WebP of this quality by libwebp with its default method, and read again; always 4:2:0.
    Webp,
    /// Written by libjpeg-turbo's encoder at this quality, as its `cjpeg` does, and read again by its decoder.
    JpegTurbo,
    /// Written by mozjpeg at this quality with its own tables and trellis quantisation, and read again by the same library.
    Mozjpeg,
    /// Written as AVIF of this quality by Debian's `avifenc` (libaom, 4:2:0, speed 6) and read again by its `avifdec`. The
    /// quality is that of libavif 1.0, whose quantiser is `63 · (1 - quality / 100)`.
    Avif,
    /// Normal noise of this standard deviation in units of [0, 1], a number per pixel and channel, then clamped and rounded.
    Noise,
    /// Gaussian blur with a kernel of this odd side and the σ that torchvision gives it; the picture is mirrored at its edges.
    Blur,
    /// Median per channel over a window of this odd side; edges are repeated.
    Median,
    /// Blend of the smoothed picture (0), the picture (1) and beyond, as torchvision's `adjust_sharpness`.
    Sharpen,
    /// Resampled to this share of its sides and left so; bilinear, antialiased when it shrinks.
    Scale,
    /// Resampled to this share of its sides and back; bilinear, antialiased on the way down.
    Rescale,
    /// Shrunk until the longer side has this many pixels, with its aspect; smaller pictures stay.
    Fit,
    /// Turned counterclockwise by degrees about the centre, bilinear; keeps its size, and corners become black as
    /// torchvision, OpenCV and Pillow leave them.
    Rotate,
    /// Turned counterclockwise by this many right angles; sides change places.
    QuarterTurns,
    /// Mirrored left to right.
    Flip,
    /// Keeps the centred window of this share of each side: 0.4 keeps 16 % of the area, 0.6 loses 40 % of each side.
    Crop,
    /// Keeps a window of this share of each side at a random place.
    CropRandom,
    /// Keeps the centred window of at most this many pixels a side, as a screenshot of a part.
    Window,
    /// White frame around the picture, as wide as this share of its shorter side (at least a pixel); the picture grows.
    Border,
    /// At a random place of a page, of whose sides it is this share; the rest is white, with boxes of random colours.
    Page,
    /// Values times this, clamped.
    Brightness,
    /// Each channel times a factor of its own: `tint:1.05/1/0.95` has one for red, green and blue, and of one range,
    /// `tint:0.95..1.05`, each draws its own.
    Tint,
    /// Values times less the farther out, as lenses and filters have it: in the corners this share is missing, and elsewhere
    /// as much less as the square of the distance from the centre is.
    Vignette,
    /// Distance of values from the mean grey of the picture times this, as torchvision's `adjust_contrast`.
    Contrast,
    /// Values of [0, 1] to this power.
    Gamma,
    /// Black lifted to this and white kept, as faded pictures and filters have it; below 0 levels are stretched to black, as
    /// programs that correct contrast by themselves do.
    Fade,
    /// Values x of [0, 1] become `x - s sin(2 pi x) / (2 pi)`: an S, with more contrast in the middle, as sliders and filters of
    /// photo editors bend curves.
    Curve,
    /// Hue (of HSV) shifted by this share of the colour circle.
    Hue,
    /// Distance of each pixel from its grey times this, as torchvision's `adjust_saturation`.
    Saturation,
    /// Luma of ITU-R BT.601 in all channels.
    Grey,
    /// Channels rounded to this many bits and spread over 0 to 255 again.
    Bits,
    /// Four rectangles at random places, filled with mid-grey, that cover at most this share of the area together.
    Mask,
    /// One rectangle of this share of the area at a random place, filled with black.
    Erase,
}

impl AttackKind {
    /// Every kind, in the order of the docs.
    pub const ALL: [Self; 33] = [
        Self::Jpeg,
        Self::Webp,
        Self::JpegTurbo,
        Self::Mozjpeg,
        Self::Avif,
        Self::Noise,
        Self::Blur,
        Self::Median,
        Self::Sharpen,
        Self::Scale,
        Self::Rescale,
        Self::Fit,
        Self::Rotate,
        Self::QuarterTurns,
        Self::Flip,
        Self::Crop,
        Self::CropRandom,
        Self::Window,
        Self::Border,
        Self::Page,
        Self::Brightness,
        Self::Tint,
        Self::Vignette,
        Self::Contrast,
        Self::Gamma,
        Self::Fade,
        Self::Curve,
        Self::Hue,
        Self::Saturation,
        Self::Grey,
        Self::Bits,
        Self::Mask,
        Self::Erase,
    ];

    /// Its name in texts, at most 14 bytes.
    pub const fn name(self) -> &'static str {
        self.row().0
    }

    /// Least and greatest strength, or `None` for a kind without.
    pub fn limits(self) -> Option<(f64, f64)> {
        self.spec().map(|limits| (limits.least, limits.most))
    }

    pub(super) const fn spec(self) -> Option<Limits> {
        self.row().1
    }

    const fn row(self) -> (&'static str, Option<Limits>) {
        let side = super::MAX_SIDE as f64;
        match self {
            Self::Jpeg => ("jpeg", limits(1.0, 100.0, Grid::Whole, None)),
            Self::Webp => ("webp", limits(0.0, 100.0, Grid::Whole, None)),
            Self::JpegTurbo => ("jpeg-turbo", limits(1.0, 100.0, Grid::Whole, None)),
            Self::Mozjpeg => ("mozjpeg", limits(1.0, 100.0, Grid::Whole, None)),
            Self::Avif => ("avif", limits(0.0, 100.0, Grid::Whole, None)),
            Self::Noise => ("noise", real(0.0, 1.0, 0.0)),
            Self::Blur => ("blur", limits(1.0, 31.0, Grid::Odd, Some(1.0))),
            // A window's values are sorted for each pixel, which takes too long for large ones.
            Self::Median => ("median", limits(1.0, 9.0, Grid::Odd, Some(1.0))),
            Self::Sharpen => ("sharpen", real(0.0, 10.0, 1.0)),
            Self::Scale => ("scale", real(0.01, 4.0, 1.0)),
            Self::Rescale => ("rescale", real(0.01, 1.0, 1.0)),
            Self::Fit => ("fit", limits(1.0, side, Grid::Whole, Some(side))),
            Self::Rotate => ("rotate", real(-360.0, 360.0, 0.0)),
            Self::QuarterTurns => ("quarter-turns", limits(0.0, 3.0, Grid::Whole, Some(0.0))),
            Self::Flip => ("flip", None),
            Self::Crop => ("crop", real(0.01, 1.0, 1.0)),
            Self::CropRandom => ("crop-random", real(0.01, 1.0, 1.0)),
            Self::Window => ("window", limits(1.0, side, Grid::Whole, Some(side))),
            Self::Border => ("border", real(0.0, 1.0, 0.0)),
            Self::Page => ("page", real(0.1, 1.0, 1.0)),
            Self::Brightness => ("brightness", real(0.0, 10.0, 1.0)),
            Self::Tint => ("tint", real(0.0, 10.0, 1.0)),
            Self::Vignette => ("vignette", real(0.0, 1.0, 0.0)),
            Self::Contrast => ("contrast", real(0.0, 10.0, 1.0)),
            Self::Gamma => ("gamma", real(0.1, 10.0, 1.0)),
            Self::Fade => ("fade", real(-1.0, 1.0, 0.0)),
            Self::Curve => ("curve", real(-1.0, 1.0, 0.0)),
            Self::Hue => ("hue", real(-1.0, 1.0, 0.0)),
            Self::Saturation => ("saturation", real(0.0, 10.0, 1.0)),
            Self::Grey => ("grey", None),
            Self::Bits => ("bits", limits(1.0, 8.0, Grid::Whole, Some(8.0))),
            Self::Mask => ("mask", real(0.0, 1.0, 0.0)),
            Self::Erase => ("erase", real(0.0, 1.0, 0.0)),
        }
    }
}
