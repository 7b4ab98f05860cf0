//! Reads a picture, or its histogram, with changes of its tones undone.
use super::BATCH;
use super::search::Reader;
use crate::error::Result;
use crate::extract::Engine;
use crate::extract::photometric::{ColourHistogram, ToneChange};
use crate::picture::Picture;

/// Reads a histogram with changes undone, those that can have been done.
pub(super) fn of_histogram<'a>(
    engine: &'a Engine,
    histogram: &'a ColourHistogram,
    whole: &'a Picture,
) -> Box<Reader<'a>> {
    let undone = move |change: &ToneChange| histogram.undone(change, whole);
    in_batches(engine, undone, |colours| engine.read_colours(colours))
}

/// Reads pictures with changes undone, those that can have been done.
pub(super) fn of_pictures<'a>(
    engine: &'a Engine,
    undone: impl Fn(&ToneChange) -> Option<Picture> + Send + Sync + 'a,
) -> Box<Reader<'a>> {
    in_batches(engine, undone, |pictures| engine.read_logits(pictures))
}

/// Reads what there was before changes, where there can have been anything.
fn in_batches<'a, T: Send + Sync>(
    engine: &'a Engine,
    undone: impl Fn(&ToneChange) -> Option<T> + Send + Sync + 'a,
    read: impl Fn(&[T]) -> Result<Vec<Vec<f32>>> + 'a,
) -> Box<Reader<'a>> {
    Box::new(move |changes| {
        let mut logits = Vec::with_capacity(changes.len());
        for chunk in changes.chunks(BATCH) {
            let before = engine.each(chunk, |change| Ok(undone(change)))?;
            let is_possible: Vec<bool> = before.iter().map(Option::is_some).collect();
            let before: Vec<T> = before.into_iter().flatten().collect();
            let mut read = read(&before)?.into_iter();
            logits.extend(
                is_possible
                    .into_iter()
                    .map(|possible| if possible { read.next() } else { None }),
            );
        }
        Ok(logits)
    })
}
