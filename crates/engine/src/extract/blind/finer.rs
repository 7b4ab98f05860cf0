//! The best candidates read at several sizes, as a picture is that is read as it was given.
use super::{Candidate, score, undone_on_white};
use crate::error::Result;
use crate::extract::Engine;
use crate::extract::restore::Restored;
use crate::extract::sizes::{larger_sides, mean, shorter_side};
use crate::picture::Picture;

/// Of the candidates of a picture so many are read at all sizes, and the last: what others read hardly ever counts, and larger
/// pictures are five times the work.
const AT_ALL_SIZES: usize = 12;

/// Candidates for what was done to a picture, which is `whole` at the side that the extractor takes in, the best with the
/// mean of their logits at all sizes; best first, but the last of those given stays the last.
///
/// # Errors
/// A failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn read(
    engine: &Engine,
    restored: &Restored<'_>,
    whole: &Picture,
    mut candidates: Vec<Candidate>,
) -> Result<Vec<Candidate>> {
    let mut readings: Vec<Vec<Vec<f32>>> = candidates.iter().map(|found| vec![found.logits.clone()]).collect();
    let last = candidates.len().checked_sub(1);
    let mut chosen: Vec<usize> = (0..last.unwrap_or(0).min(AT_ALL_SIZES)).chain(last).collect();
    // Each part is made small once, for all of its candidates.
    while let Some(part) = chosen.first().map(|place| candidates[*place].part) {
        let (of_part, others): (Vec<_>, Vec<_>) = chosen.into_iter().partition(|place| candidates[*place].part == part);
        chosen = others;
        let shown = part.of(restored);
        // What was read of a histogram is read once more of the picture.
        let own = Some(engine.extractor.side()).filter(|_| !engine.extractor.colour_scales().is_empty());
        for side in own
            .into_iter()
            .chain(larger_sides(engine.extractor.as_ref(), shorter_side(&shown)))
        {
            let shown = engine.resized_to(side, &shown)?;
            let undone = engine.each(&of_part, |place| Ok(undone(&candidates[*place], &shown, whole)))?;
            let possible = of_part.iter().copied().zip(undone);
            let (places, pictures): (Vec<usize>, Vec<Picture>) =
                possible.filter_map(|(place, undone)| Some((place, undone?))).unzip();
            for (place, logits) in places.into_iter().zip(engine.read_logits_at(side, &pictures)?) {
                match Some(side) == own {
                    true => readings[place] = vec![logits],
                    false => readings[place].push(logits),
                }
            }
        }
    }
    for (candidate, readings) in candidates.iter_mut().zip(readings) {
        let cost = score::of_logits(&candidate.logits) - candidate.score;
        candidate.logits = mean(&readings);
        candidate.score = score::of_logits(&candidate.logits) - cost;
    }
    if let Some((_, best)) = candidates.split_last_mut() {
        best.sort_by(|a, b| b.score.total_cmp(&a.score));
    }
    Ok(candidates)
}

/// What a candidate reads of a part that is shown at some size; `None` where it can't be read so.
fn undone(candidate: &Candidate, shown: &Picture, whole: &Picture) -> Option<Picture> {
    match candidate.white {
        true => undone_on_white(&candidate.change, shown, whole),
        false => Some(shown.clone()),
    }
}
