//! What may have been done to a picture, and is undone before it is read.
//!
//! Each hypothesis is read for itself, and whoever decides on the best of them pays for all.
use std::fmt;

/// Steps in which windows are told, of a side.
pub const WINDOW_STEPS: u32 = 12;

/// What is undone before a picture is read: its tones first, then borders are cut off, then it is turned, then mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hypothesis {
    /// Counterclockwise, 0 to 3.
    pub quarter_turns: u8,
    /// Left and right are exchanged.
    pub mirrored: bool,
    /// Borders of one colour are cut off.
    pub trimmed: bool,
    /// What was done to its tones.
    pub correction: PhotometricCorrection,
    /// A part of it is read, the rest is not.
    pub window: Option<Window>,
    /// The number of the one picture, from 1, that this was done to; each of the others is read in the way that agrees best
    /// with it. `None` where it was done to all pictures alike. The message that is claimed has no say in what agrees, so one
    /// reading is paid for.
    pub leader: Option<u32>,
}

/// What may have been done to the tones of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PhotometricCorrection {
    /// Nothing: it is read as it is.
    #[default]
    None,
    /// Something that left its background neither black nor white, such as noise: what is seen of it is made white.
    WhiteBackground,
    /// Its channels were multiplied, and with them a background that had been white and tells by how much. What it can't tell,
    /// since it was cut at white, is this: factors of red, green and blue. In a picture without such a background each stands
    /// for another one ([`tint_without_ground`]).
    WhiteBalance([f32; 3]),
    /// Its tones were changed, and with them its background.
    Tone(Tone),
    /// Whatever was done to its tones, and whichever part of it shows the scene, was estimated from the picture and the
    /// key alone. The message that is claimed has no say in it, so however many were looked at, one is paid for.
    Estimated,
    /// The same by what was nearly believed instead: the second best estimate, the third and so on ([`NEXT_ESTIMATES`] of
    /// them), each a hypothesis of its own.
    NextEstimate(u32),
    /// It is compared with the unmarked original, registered with it: what it shows otherwise is read, and whatever lies behind
    /// the scene is not. The message that is claimed has no say in it, either.
    Registered(RegisteredTones),
    /// It is compared with the unmarked original, and what it shows otherwise with the change that each bit asks for (a matched
    /// filter). The message that is claimed has no say in it, either.
    MatchedFilter,
}

/// Places of estimates that are read besides the best one, of a picture that is read alone: where the best is wrong, the
/// right one may be among these.
pub const NEXT_ESTIMATES: std::ops::RangeInclusive<u32> = 2..=4;

/// How the tones of a picture are taken that is compared with the original. Both ways are read, and whoever takes the better
/// one pays for both: a fit undoes any filter, and a part of the mark with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RegisteredTones {
    /// As they are: nobody changed them.
    AsGiven,
    /// Changed from those of the original by a filter, which is fitted.
    Fitted,
}

impl RegisteredTones {
    /// All ways.
    pub const ALL: [Self; 2] = [Self::AsGiven, Self::Fitted];
}

/// In words.
impl fmt::Display for RegisteredTones {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AsGiven => "compared with the original, tones as given",
            Self::Fitted => "compared with the original, tones fitted to it",
        })
    }
}

/// What a channel is taken to have been multiplied by where no background tells, for a factor of
/// [`PhotometricCorrection::WhiteBalance`]: 0.96, 1 and 1.04 for the three that are tried, 1, 1.025 and 1.05.
pub fn tint_without_ground(factor: f32) -> f32 {
    1.0 + 1.6 * (factor - 1.025)
}

/// Something that was done to all pixels of a picture alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tone {
    /// Values were multiplied by this.
    Brightness(f32),
    /// Values in [0, 1] were raised to this power.
    Gamma(f32),
    /// The distance of values from the picture's mean grey was multiplied by this.
    Contrast(f32),
    /// The distance of a pixel's values from its grey was multiplied by this.
    Saturation(f32),
}

/// A part of a picture, of the same aspect; in twelfths of its sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// From the left edge.
    pub left: u32,
    /// From the top edge.
    pub top: u32,
    /// Of both sides.
    pub side: u32,
}

impl Hypothesis {
    /// What was done to each picture is estimated from it.
    pub fn estimated() -> Self {
        Self {
            correction: PhotometricCorrection::Estimated,
            ..Self::default()
        }
    }

    /// What was done to a picture is what the estimate at this place says, 1 being the best.
    pub fn estimated_next(place: u32) -> Self {
        Self {
            correction: PhotometricCorrection::NextEstimate(place),
            ..Self::default()
        }
    }

    /// What pictures show otherwise than the original is compared with what each bit asks for.
    pub fn matched_filter() -> Self {
        Self {
            correction: PhotometricCorrection::MatchedFilter,
            ..Self::default()
        }
    }

    /// Each picture is compared with the original.
    pub fn registered(tones: RegisteredTones) -> Self {
        Self {
            correction: PhotometricCorrection::Registered(tones),
            ..Self::default()
        }
    }
}

/// In words, "as given" where nothing is undone.
impl fmt::Display for Hypothesis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut undone = Vec::new();
        match self.correction {
            PhotometricCorrection::None => {}
            PhotometricCorrection::WhiteBackground => undone.push("ground made white".to_owned()),
            PhotometricCorrection::WhiteBalance(beyond) => undone.push(white_balance(beyond)),
            PhotometricCorrection::Tone(tone) => undone.push(format!("{tone} undone")),
            PhotometricCorrection::Estimated => undone.push("tones and part estimated from each picture".into()),
            PhotometricCorrection::NextEstimate(place) => {
                undone.push(format!("tones and part by estimate {place} of this picture"));
            }
            PhotometricCorrection::Registered(tones) => undone.push(tones.to_string()),
            PhotometricCorrection::MatchedFilter => {
                undone.push("compared with the original by a matched filter".into());
            }
        }
        if self.quarter_turns > 0 {
            undone.push(format!("turned by {} degrees", 90 * u32::from(self.quarter_turns)));
        }
        if self.mirrored {
            undone.push("mirrored".into());
        }
        if self.trimmed {
            undone.push("without borders".into());
        }
        undone.extend(self.window.map(|window| window.to_string()));
        match undone.is_empty() {
            true => f.write_str("as given")?,
            false => f.write_str(&undone.join(", "))?,
        }
        match self.leader {
            None => Ok(()),
            Some(picture) => write!(f, ": picture {picture}, the others as they agree with it"),
        }
    }
}

fn white_balance(factors: [f32; 3]) -> String {
    let told = |factors: [f32; 3]| factors.map(|factor| format!("{factor:.2}")).join(", ");
    let (beyond, tints) = (told(factors), told(factors.map(tint_without_ground)));
    format!("white balance undone: red, green, blue x {beyond} beyond a white ground, x {tints} without one")
}

impl fmt::Display for Tone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Brightness(factor) => write!(f, "brightness x {factor:.2}"),
            Self::Gamma(exponent) => write!(f, "gamma {exponent:.2}"),
            Self::Contrast(factor) => write!(f, "contrast x {factor:.2}"),
            Self::Saturation(factor) => write!(f, "saturation x {factor:.2}"),
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent =
            |twelfths: u32| (100 * u64::from(twelfths) + u64::from(WINDOW_STEPS / 2)) / u64::from(WINDOW_STEPS);
        let [left, top, side] = [self.left, self.top, self.side].map(percent);
        write!(f, "{side} % of its sides from {left} % right and {top} % down")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hypotheses_are_told_in_words() {
        assert_eq!(Hypothesis::default().to_string(), "as given");
        let all = Hypothesis {
            quarter_turns: 3,
            mirrored: true,
            trimmed: true,
            correction: PhotometricCorrection::Tone(Tone::Brightness(0.81)),
            window: Some(Window {
                left: 3,
                top: 6,
                side: 6,
            }),
            leader: None,
        };
        let told = "brightness x 0.81 undone, turned by 270 degrees, mirrored, without borders, 50 % of its sides from \
                    25 % right and 50 % down";
        assert_eq!(all.to_string(), told);
        let white = Hypothesis {
            correction: PhotometricCorrection::WhiteBackground,
            ..Hypothesis::default()
        };
        assert_eq!(white.to_string(), "ground made white");
        assert_eq!(
            Hypothesis::estimated().to_string(),
            "tones and part estimated from each picture"
        );
        assert_eq!(
            Hypothesis::registered(RegisteredTones::Fitted).to_string(),
            "compared with the original, tones fitted to it"
        );
        assert_eq!(
            Hypothesis::matched_filter().to_string(),
            "compared with the original by a matched filter"
        );
        let led = Hypothesis {
            leader: Some(2),
            ..Hypothesis::default()
        };
        assert_eq!(led.to_string(), "as given: picture 2, the others as they agree with it");
    }
}
