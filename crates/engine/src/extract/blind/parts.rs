//! Parts of a picture that may be all that shows the scene.
use std::borrow::Cow;

use guardsplat_codeword::Window;

use crate::error::Result;
use crate::extract::restore::Restored;
use crate::extract::window::{self, crop, windows_of};
use crate::extract::{Engine, without_borders};
use crate::picture::Picture;

/// How much better a window must look than the whole, as the logarithm of the size of logits.
const BETTER: f64 = 0.1;

/// Which part of a picture is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Part {
    /// All of it.
    Whole,
    /// All but borders of one colour.
    Trimmed,
    /// All but the backdrop.
    WithoutBackdrop,
    /// A window.
    Window(Window),
}

impl Part {
    /// What it is of a picture.
    pub(super) fn of<'a>(&self, restored: &'a Restored<'_>) -> Cow<'a, Picture> {
        let picture = restored.picture.as_ref();
        match self {
            Self::Whole => Cow::Borrowed(picture),
            Self::WithoutBackdrop => Cow::Borrowed(restored.without_backdrop.as_ref().unwrap_or(picture)),
            Self::Trimmed => without_borders(picture).map_or(Cow::Borrowed(picture), Cow::Owned),
            Self::Window(window) => Cow::Owned(crop(*window, picture)),
        }
    }

    /// What a part must gain to be believed: there are many, and any shows some colours.
    pub(super) fn cost(&self) -> f64 {
        match self {
            Self::Whole | Self::Trimmed | Self::WithoutBackdrop => 0.0,
            Self::Window(_) => BETTER,
        }
    }
}

/// All parts at the side that the extractor takes in, `whole` being the picture so. First comes what is within its
/// borders, or the whole if it has none.
pub(super) fn parts(engine: &Engine, restored: &Restored<'_>, whole: &Picture) -> Result<Vec<(Part, Picture)>> {
    let picture = restored.picture.as_ref();
    let mut parts = Vec::new();
    if let Some(trimmed) = without_borders(picture) {
        parts.push((Part::Trimmed, engine.resized(&trimmed)?));
    }
    parts.push((Part::Whole, whole.clone()));
    if let Some(picture) = &restored.without_backdrop {
        parts.push((Part::WithoutBackdrop, engine.resized(picture)?));
    }
    let windows: Vec<Window> = windows_of(picture).collect();
    let small = window::small(engine, &windows, picture)?;
    parts.extend(windows.into_iter().map(Part::Window).zip(small));
    Ok(parts)
}
