//! Names that records carry and reports ask for: experiments' variants of the settings, and attacks.
//!
//! Records may carry any others; these are the ones that a report expects, and says are "not measured" without.

/// The variant with all settings as they are by default: DC and rest are learned, with a PSNR that is held.
pub const STANDARD: &str = "standard";
/// All attributes of the Gaussians are learned.
pub const ALL_ATTRIBUTES: &str = "all attributes";
/// Only the constant band of the spherical harmonics is learned.
pub const DC: &str = "dc";
/// Only the other bands are learned.
pub const REST: &str = "rest";
/// The preset `robust`, trained to stand what is done to pictures.
pub const ROBUST: &str = "robust";
/// Training views are on one circle around the scene, instead of over the sphere.
pub const RING: &str = "ring";
/// Only the message counts.
pub const MESSAGE_ONLY: &str = "message only";
/// Message and likeness count with weights that stay as they are, instead of being changed so that a PSNR is held.
pub const FIXED_WEIGHTS: &str = "fixed weights";

/// Variants that change the weight of likeness are called this, and what it is multiplied by; weights are fixed then.
pub const LAMBDA_RECON: &str = "lambda-recon:";
/// The same of the message's weight.
pub const LAMBDA_MSG: &str = "lambda-msg:";

/// Variants that are timed are called this, the kind of device, a colon, and their own name, such as
/// "trade:cpu:draft": one folder can hold those of several devices, and marks that other experiments made at other times
/// are not among them.
pub const TRADE: &str = "trade:";
/// Detections of what must be found, replaced bits instead of marks, are called this and the detector.
pub const CONTROL: &str = "control:";

/// A marked scene that is given as it is, and rendered by whoever looks for the mark.
pub const SCENE: &str = "scene";
/// Pictures of the scene before it was marked.
pub const UNMARKED: &str = "unmarked";

/// Views as they are.
pub const NONE: &str = "none";
/// Lowest opacity first, a quarter of the Gaussians.
pub const PRUNE_LOWEST: &str = "prune-lowest:0.25";
/// At random, a quarter of the Gaussians.
pub const PRUNE_RANDOM: &str = "prune-random:0.25";
/// Attacks that remove the Gaussians of lowest opacity are called this, and the share.
pub const PRUNE_LOWEST_PREFIX: &str = "prune-lowest:";
/// Attacks that remove Gaussians at random are called this, and the share.
pub const PRUNE_RANDOM_PREFIX: &str = "prune-random:";
/// Attacks that add noise to the spherical harmonics are called this, and its standard deviation.
pub const SH_NOISE: &str = "sh-noise:";
/// Attacks that cover part of each view are called this, and the share.
pub const OCCLUSION: &str = "occlusion:";
/// Conversions to another format and back are called this, and the format.
pub const FORMAT: &str = "format:";
/// Bands of spherical harmonics above a degree are dropped: `sh-degree:0`.
pub const SH_DEGREE: &str = "sh-degree:";
/// Formats that scenes can have.
pub const FORMATS: [&str; 5] = ["ply", "compressed-ply", "spz", "splat", "sog"];
/// What a mark is read after to know which formats it survives: nothing, each format, and what formats drop most of.
pub fn formats() -> Vec<String> {
    let formats = FORMATS.map(|format| format!("{FORMAT}{format}"));
    std::iter::once(NONE.into())
        .chain(formats)
        .chain([format!("{SH_DEGREE}0")])
        .collect()
}

/// What happens to pictures that people pass on: compressed, compressed hard, noisy, cropped, and a screenshot of a brighter
/// screen. What variants of the settings are worth is told by the mean over these.
pub const SHARED: [&str; 5] = [
    "jpeg-turbo:50..95",
    "jpeg-turbo:30",
    "noise:0.05",
    "crop:0.6",
    "brightness:1.05+crop:0.8+fit:600+jpeg:80",
];

/// Compressed by the learned codec of quality 3, whose weights somebody has to give.
pub const VAE: &str = "vae:3";
/// Attacks of the paper's Table 2, in its order.
pub const PAPER_ATTACKS: [&str; 10] = [
    NONE,
    "noise:0.1",
    "rotate:-30..30",
    "scale:0.75..1.25",
    "blur:3",
    "crop:0.4",
    "brightness:0.5..1.5",
    "jpeg:10",
    VAE,
    "crop:0.4+brightness:0.5..1.5+jpeg:10",
];
