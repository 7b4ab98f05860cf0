//! What marks are to stand: the lines of the robustness table, with what is asked of each kind of mark.
mod lines;

pub use lines::{LINES, Line, SCREENSHOT};

use super::names::{ROBUST, STANDARD};

/// Least PSNR of marks in dB.
pub const PSNR_DB: f64 = 38.0;

/// A kind of mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Column {
    /// The preset `standard`, 32 bits.
    Standard,
    /// The preset `robust`, 16 bits.
    Robust,
    /// The words of assets: `standard`, 64 bits.
    Claims,
}

impl Column {
    /// All of them, in the order in which they are told.
    pub const ALL: [Self; 3] = [Self::Standard, Self::Robust, Self::Claims];

    /// Variant of the settings.
    pub fn variant(self) -> &'static str {
        match self {
            Self::Standard | Self::Claims => STANDARD,
            Self::Robust => ROBUST,
        }
    }

    /// Bits of the message.
    pub fn bits(self) -> u32 {
        match self {
            Self::Standard => 32,
            Self::Robust => 16,
            Self::Claims => 64,
        }
    }

    /// Pictures that are read together.
    pub fn pictures(self) -> u32 {
        match self {
            Self::Standard | Self::Robust => 5,
            Self::Claims => 3,
        }
    }

    /// Whether pictures read together are to match as a claim does. 16 bits never can at the usual rate: of those the
    /// whole message is to be right.
    pub fn claims(self) -> bool {
        self != Self::Robust
    }

    /// Lines that are asked of it, and what of each.
    pub fn lines(self) -> impl Iterator<Item = (&'static Line, Target)> {
        LINES.iter().filter_map(move |line| Some((line, line.target(self)?)))
    }
}

/// What is asked of a mark under an attack, in percent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Bits that are right in one picture.
    pub accuracy: Option<f64>,
    /// Marks that match, or whose whole message is right, from several pictures together.
    pub matches: Option<f64>,
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::attack::Attack;
    use crate::report::names::OCCLUSION;

    #[test]
    fn attacks_can_be_read_and_stand_in_one_line_only() {
        let attacks: Vec<&str> = LINES.iter().flat_map(|line| line.attacks).copied().collect();
        for attack in &attacks {
            // What covers parts of views has a name of its own, which the worker knows.
            let known = attack.replace(OCCLUSION, "mask:");
            assert_eq!(known.parse::<Attack>().unwrap().to_string(), known);
        }
        let distinct: BTreeSet<&str> = attacks.iter().copied().collect();
        assert_eq!(distinct.len(), attacks.len());
    }

    #[test]
    fn columns_have_their_lines() {
        let names = |column: Column| -> Vec<&str> { column.lines().map(|(line, _)| line.name).collect() };
        assert_eq!(names(Column::Robust).len(), LINES.len());
        for missing in ["noise 0.1", "blur 3"] {
            assert!(!names(Column::Standard).contains(&missing));
        }
        let claims = names(Column::Claims);
        assert!(claims.contains(&"JPEG 30") && claims.contains(&"screenshot"));
        for missing in ["noise 0.1", "JPEG 10", "occlusion 10 %"] {
            assert!(!claims.contains(&missing), "{missing}");
        }
        let screenshot = Column::Standard
            .lines()
            .find(|(line, _)| line.name == "screenshot")
            .unwrap();
        assert_eq!((screenshot.1.accuracy, screenshot.1.matches), (Some(92.0), Some(95.0)));
    }
}
