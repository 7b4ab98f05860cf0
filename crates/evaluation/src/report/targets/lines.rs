//! The lines: what is done to pictures, and what is asked of marks then.
use super::{Column, Target};
use crate::report::names::NONE;

/// A line of the table: attacks of which each is to be stood by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// What it is called.
    pub name: &'static str,
    /// The attacks.
    pub attacks: &'static [&'static str],
    /// Bits asked of one picture of `standard`, then of `robust`, in percent.
    accuracy: [Option<f64>; 2],
    /// Marks asked of five pictures together, the same.
    matches: [Option<f64>; 2],
    /// Whether claims are to match after it.
    claimed: bool,
}

/// Share of claims that are to match after each of their lines.
const CLAIMS: f64 = 97.0;

impl Line {
    pub(super) fn target(&self, column: Column) -> Option<Target> {
        let place = match column {
            Column::Standard => 0,
            Column::Robust => 1,
            Column::Claims => {
                return self.claimed.then_some(Target {
                    accuracy: None,
                    matches: Some(CLAIMS),
                });
            }
        };
        self.accuracy[place].map(|accuracy| Target {
            accuracy: Some(accuracy),
            matches: self.matches[place],
        })
    }
}

/// A line that both presets are to stand, and claims.
const fn all(name: &'static str, attacks: &'static [&'static str], standard: f64, robust: f64) -> Line {
    Line {
        claimed: true,
        ..both(name, attacks, standard, robust)
    }
}

const fn both(name: &'static str, attacks: &'static [&'static str], standard: f64, robust: f64) -> Line {
    Line {
        name,
        attacks,
        accuracy: [Some(standard), Some(robust)],
        matches: [None, None],
        claimed: false,
    }
}

const fn robust(name: &'static str, attacks: &'static [&'static str], robust: f64) -> Line {
    Line {
        accuracy: [None, Some(robust)],
        ..both(name, attacks, 0.0, robust)
    }
}

/// The lines, in the order in which they are told.
pub const LINES: [Line; 26] = [
    all("as they are", &[NONE], 99.0, 99.6),
    all(
        "JPEG 50 to 95",
        &["jpeg:50..95", "jpeg-turbo:50..95", "mozjpeg:50..95"],
        97.0,
        99.0,
    ),
    all("WebP 75", &["webp:75"], 97.0, 99.0),
    all("AVIF 50", &["avif:50"], 97.0, 99.0),
    all("halved", &["scale:0.5"], 97.0, 99.0),
    all("cropped to 0.6", &["crop:0.6"], 97.0, 99.0),
    all("turned by 20°", &["rotate:20"], 97.0, 99.0),
    all("brightness ±20 %", &["brightness:0.8..1.2"], 95.0, 98.0),
    all("contrast ±20 %", &["contrast:0.8..1.2"], 95.0, 98.0),
    all("saturation ±20 %", &["saturation:0.8..1.2"], 95.0, 98.0),
    all("gamma 0.8 to 1.25", &["gamma:0.8..1.25"], 95.0, 98.0),
    all("tint ±5 %", &["tint:0.95..1.05"], 95.0, 98.0),
    all("noise 0.02", &["noise:0.02"], 97.0, 99.0),
    all("noise 0.05", &["noise:0.05"], 93.0, 98.0),
    robust("noise 0.1", &["noise:0.1"], 97.0),
    Line {
        matches: [Some(95.0), Some(99.0)],
        ..all("screenshot", &[SCREENSHOT], 92.0, 98.0)
    },
    all("JPEG 30", &["jpeg:30", "jpeg-turbo:30", "mozjpeg:30"], 93.0, 98.0),
    both("JPEG 10", &["jpeg:10", "jpeg-turbo:10", "mozjpeg:10"], 80.0, 95.0),
    robust("crop 0.4", &["crop:0.4"], 98.7),
    robust("brightness 0.5 to 1.5", &["brightness:0.5..1.5"], 97.5),
    robust("rotation ±30°", &["rotate:-30..30"], 98.0),
    robust("scaling 0.75 to 1.25", &["scale:0.75..1.25"], 99.0),
    robust("blur 3", &["blur:3"], 99.3),
    robust(
        "crop, brightness and JPEG 10",
        &["crop:0.4+brightness:0.5..1.5+jpeg:10"],
        93.4,
    ),
    both("occlusion 10 %", &["occlusion:0.1"], 95.0, 98.0),
    both("occlusion 20 %", &["occlusion:0.2"], 90.0, 95.0),
];

/// Somebody's screenshot: 5 % brighter, cropped to 0.8, resized to 600 pixels, saved as JPEG 80.
pub const SCREENSHOT: &str = "brightness:1.05+crop:0.8+fit:600+jpeg:80";
