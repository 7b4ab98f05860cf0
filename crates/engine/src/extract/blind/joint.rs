//! Which candidates of several pictures of one scene are right: those that carry the same message.
use super::{BlindReading, Candidate, score};

/// Most candidates of a picture that are looked at.
pub(super) const MOST: usize = 24;
/// How often every picture may change its mind.
const ROUNDS: usize = 3;

/// The chosen candidate of each picture, `None` of one that has none. Each begins with its own best, and then takes what
/// makes the sum over all pictures look most like a mark, whatever that says.
pub(in crate::extract) fn chosen<'a>(pictures: &[&'a BlindReading]) -> Vec<Option<&'a Candidate>> {
    let mut places = vec![0; pictures.len()];
    let mut sum = vec![0.0_f32; pictures.iter().map(|picture| picture.bits).max().unwrap_or(0)];
    let add = |sum: &mut [f32], picture: usize, place: usize, sign: f32| {
        let candidate = pictures[picture].candidates.get(place);
        for (sum, v) in sum.iter_mut().zip(candidate.map_or(&[][..], |c| &c.logits)) {
            *sum += sign * v;
        }
    };
    (0..pictures.len()).for_each(|picture| add(&mut sum, picture, 0, 1.0));
    let rounds = if pictures.len() > 1 { ROUNDS } else { 0 };
    for _ in 0..rounds {
        let before = places.clone();
        for (picture, read) in pictures.iter().enumerate() {
            add(&mut sum, picture, places[picture], -1.0);
            let scored = read.candidates.iter().enumerate().map(|(place, candidate)| {
                let with: Vec<f32> = sum.iter().zip(&candidate.logits).map(|(a, b)| a + b).collect();
                let own = (candidate.score - score::of_logits(&candidate.logits)) / pictures.len() as f64;
                (place, score::of_logits(&with) + own)
            });
            // The first of equal ones.
            let best = scored.fold(
                (0, f64::NEG_INFINITY),
                |best, now| if now.1 > best.1 { now } else { best },
            );
            places[picture] = best.0;
            add(&mut sum, picture, places[picture], 1.0);
        }
        if places == before {
            break;
        }
    }
    pictures
        .iter()
        .zip(places)
        .map(|(picture, place)| picture.candidates.get(place))
        .collect()
}
