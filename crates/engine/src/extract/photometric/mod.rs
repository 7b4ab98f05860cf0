//! Guesses at what was done to the tones of a picture, each undone and read.
//!
//! The shipped CLIP reads exact colours: a picture that was brightened by a twentieth reads as another one. What was done
//! is not known, so it is guessed. Logits do not tell which guess is right (a smooth unmarked surface has large ones,
//! too): the message that is claimed does, **and every guess is another chance to match it, which a claim must count**.
mod ground;
mod tone;

pub use tone::Tone;

use super::Engine;
use crate::error::Result;
use crate::picture::Picture;

/// Guesses that are read together.
const BATCH: usize = 8;

/// What may have been done to a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Guess {
    /// Nothing: it is read as it is.
    #[default]
    Nothing,
    /// Something that left its ground neither black nor white, such as noise.
    Ground,
    /// Its tones were changed, and with them its ground.
    Tone(Tone),
}

/// All guesses, nothing first: what [`read_guesses`] reads.
pub fn guesses(engine: &Engine) -> Vec<Guess> {
    let mut all = vec![Guess::Nothing];
    if engine.extractor.reads_exact_colours() {
        all.push(Guess::Ground);
        all.extend(tone::all().into_iter().map(Guess::Tone));
    }
    all
}

/// Logits of a picture under each guess, in the order of [`guesses`].
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub fn read_guesses(engine: &Engine, picture: &Picture) -> Result<Vec<Vec<f32>>> {
    let mut logits = engine.read_logits(std::slice::from_ref(picture))?;
    let small = engine.resized(picture)?;
    for chunk in guesses(engine)[1..].chunks(BATCH) {
        let pictures: Vec<Picture> = chunk.iter().map(|guess| guess.undone(&small)).collect();
        logits.extend(engine.read_logits(&pictures)?);
    }
    Ok(logits)
}

impl std::fmt::Display for Guess {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Nothing => f.write_str("as it is"),
            Self::Ground => f.write_str("ground made white"),
            Self::Tone(tone) => write!(f, "{tone} undone"),
        }
    }
}

impl Guess {
    /// The picture before that was done to it, over white where its ground is seen.
    fn undone(self, picture: &Picture) -> Picture {
        let toned = match self {
            Self::Nothing => return picture.clone(),
            Self::Ground => None,
            Self::Tone(tone) => Some(tone.undone(picture)),
        };
        let toned = toned.as_ref().unwrap_or(picture);
        ground::whitened(toned).unwrap_or_else(|| toned.clone())
    }
}
