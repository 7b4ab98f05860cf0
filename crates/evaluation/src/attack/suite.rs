//! Named sets of attacks.
use super::chain::Attack;
use crate::{Error, Result};

/// The robustness table of the paper (GuardSplat, CVPR 2025), at the strengths that it states.
///
/// - Noise has the σ of 0.1 of the paper; the public code squares it and so adds 0.01, which is in `all`.
/// - Scaling is 0.75 to 1.25 as in the paper; the public code stops at 1.
/// - "Crop 40 %" keeps a window of 40 % of each side, that is, 16 % of the area, as the public code does. The milder
///   reading, which loses 40 % of each side, is `crop:0.6`, in `everyday`.
/// - Rotation is bilinear here and takes the nearest pixel in the public code.
/// - VAE compression, a trained network, is no part of this crate; `evaluate --vae` adds it.
const PAPER: [&str; 9] = [
    "none",
    "noise:0.1",
    "rotate:-30..30",
    "scale:0.75..1.25",
    "blur:3",
    "crop:0.4",
    "brightness:0.5..1.5",
    "jpeg:10",
    "crop:0.4+brightness:0.5..1.5+jpeg:10",
];

/// What users do to pictures without meaning to remove a mark.
const EVERYDAY: [&str; 28] = [
    "none",
    // Exports of photo editors, libjpeg's default, and what messengers send.
    "jpeg:95",
    "jpeg:75",
    "jpeg:50",
    // libwebp's default, and small pictures on the web.
    "webp:75",
    "webp:50",
    // A smaller copy, a thumbnail enlarged again, previews of services, and a screenshot of a part.
    "scale:0.5",
    "rescale:0.5",
    "fit:512",
    "window:512",
    // A margin cut away, a part chosen, with the motif in the middle or not.
    "crop:0.9",
    "crop:0.6",
    "crop-random:0.6",
    // Straightened, turned by the wrong orientation tag, mirrored, framed.
    "rotate:-3..3",
    "quarter-turns:1",
    "flip",
    "border:0.1",
    // Sliders and filters of photo editors.
    "brightness:0.8..1.2",
    "contrast:0.8..1.2",
    "gamma:0.8..1.25",
    "saturation:0.5..1.5",
    "hue:-0.05..0.05",
    "grey",
    "sharpen:2",
    "blur:3",
    // Few colours, as in palettes and old screens.
    "bits:5",
    // Posted: shrunk by the service; edited, cut and posted.
    "fit:1080+jpeg:75",
    "crop:0.8+brightness:1.2+jpeg:75",
];

/// Stronger ones, by which curves over strength are drawn, and those that mean to remove a mark.
const HARDER: [&str; 27] = [
    "jpeg:30",
    "webp:20",
    "webp:10",
    "noise:0.01",
    "noise:0.02",
    "noise:0.05",
    "blur:7",
    "blur:11",
    "median:3",
    "median:5",
    "scale:0.25",
    "rescale:0.25",
    "rotate:10",
    "rotate:30",
    "rotate:45",
    "quarter-turns:2",
    "crop-random:0.4",
    "brightness:0.5",
    "brightness:1.5",
    "contrast:0.5..1.5",
    "gamma:0.5..2",
    "hue:-0.5..0.5",
    "bits:3",
    "mask:0.2",
    "erase:0.2",
    "crop:0.6+brightness:1.3+jpeg:50",
    "rotate:-10..10+crop:0.8+blur:3+noise:0.02+webp:50",
];

impl Attack {
    /// Names that [`Attack::suite`] knows.
    pub const SUITES: [&str; 3] = ["paper", "everyday", "all"];

    /// A named set: `paper`, the rows of the paper's robustness table; `everyday`, what users do to pictures; `all`, both,
    /// each attack once, and stronger ones. Every set begins with `none`.
    ///
    /// # Errors
    /// [`Error::BadOption`] for another name.
    pub fn suite(name: &str) -> Result<Vec<Self>> {
        let texts: Vec<&str> = match name {
            "paper" => PAPER.to_vec(),
            "everyday" => EVERYDAY.to_vec(),
            "all" => {
                let new = EVERYDAY.iter().filter(|text| !PAPER.contains(text));
                PAPER.iter().chain(new).chain(&HARDER).copied().collect()
            }
            other => {
                return Err(Error::BadOption {
                    field: "suite",
                    reason: format!(
                        "{:?} is none of {}",
                        super::strength::start_of(other),
                        Self::SUITES.join(", ")
                    ),
                });
            }
        };
        texts.into_iter().map(str::parse).collect()
    }
}
