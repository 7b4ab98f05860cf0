//! One picture read in every framing, and pictures of one suspect taken together.
use super::window::Window;
use super::{Engine, Framing, Reading, without_borders};
use crate::error::Result;
use crate::picture::Picture;

/// What was read of one picture in each framing.
#[derive(Clone, Debug, PartialEq)]
pub struct Framed {
    whole: Vec<Vec<f32>>,
    /// Without its borders, if it has any.
    trimmed: Option<Vec<Vec<f32>>>,
    /// Its parts, if it is large enough and the engine reads parts.
    parts: Option<Vec<Vec<f32>>>,
}

impl Framed {
    /// Reads a picture in every framing that the engine tries.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read(engine: &Engine, picture: &Picture) -> Result<Self> {
        let whole = Framing::read(engine, picture)?;
        let trimmed = without_borders(picture)
            .map(|trimmed| Framing::read(engine, &trimmed))
            .transpose()?;
        let parts = match engine.extractor.reads_exact_colours() {
            true => Window::read(engine, picture)?,
            false => None,
        };
        Ok(Self { whole, trimmed, parts })
    }

    /// Logits of the picture as it was given.
    pub fn as_given(&self) -> &[f32] {
        self.whole.first().map_or(&[], Vec::as_slice)
    }
}

/// Readings of pictures of one suspect, all in the same framing, as given first. Framings without borders are there only
/// if some picture has any, and parts if some picture is large enough: others would be the same once more.
///
/// # Errors
/// No pictures, or logits that are not finite.
pub fn framings(engine: &Engine, pictures: &[Framed]) -> Result<Vec<(Framing, Reading)>> {
    let borders = pictures.iter().any(|picture| picture.trimmed.is_some());
    let mut readings = Vec::new();
    for trimmed in [false, true].into_iter().filter(|trimmed| borders || !trimmed) {
        for (place, framing) in Framing::tried(engine, trimmed).into_iter().enumerate() {
            let of_picture = |picture: &Framed| match (&picture.trimmed, trimmed) {
                (Some(logits), true) => logits[place].clone(),
                _ => picture.whole[place].clone(),
            };
            readings.push((framing, Reading::new(pictures.iter().map(of_picture).collect())?));
        }
    }
    if pictures.iter().any(|picture| picture.parts.is_some()) {
        for (place, window) in Window::tried().enumerate() {
            let of_picture = |picture: &Framed| match &picture.parts {
                Some(logits) => logits[place].clone(),
                None => picture.as_given().to_vec(),
            };
            let reading = Reading::new(pictures.iter().map(of_picture).collect())?;
            readings.push((Framing::of(window), reading));
        }
    }
    Ok(readings)
}
