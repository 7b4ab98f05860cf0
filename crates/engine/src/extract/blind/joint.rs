//! Which candidates of several pictures of one scene are right: those that carry the same message.
use super::{BlindReading, Candidate, score, sweep};

/// Most candidates of a picture that are looked at.
pub(super) const MOST: usize = 40;
/// How often every picture may change its mind.
const ROUNDS: usize = 3;
/// Pictures whose candidates are tried for all pictures, and how many of each.
const LEADERS: (usize, usize) = (8, 6);

/// A choice of one candidate a picture, by their places.
struct Choice {
    places: Vec<usize>,
    score: f64,
}

/// The chosen candidate of each picture, `None` of one that has none.
///
/// The sum over all pictures is to look most like a mark, whatever that says. Pictures often share what was done to them,
/// and one picture alone may mislead: so a choice begins with each picture's own best, and others with what comes nearest
/// to one change in all pictures. From there each picture in turn takes what makes the sum look best.
pub(in crate::extract) fn chosen<'a>(pictures: &[&'a BlindReading]) -> Vec<Option<&'a Candidate>> {
    let own = climbed(pictures, vec![0; pictures.len()]);
    let (leaders, of_each) = if pictures.len() > 1 { LEADERS } else { (0, 0) };
    let shared = pictures
        .iter()
        .take(leaders)
        .flat_map(|leader| leader.candidates.iter().take(of_each).chain(leader.candidates.last()))
        .map(|candidate| climbed(pictures, nearest(pictures, candidate)));
    // The first of equal ones.
    let best = shared.fold(own, |best, now| if now.score > best.score { now } else { best });
    pictures
        .iter()
        .zip(best.places)
        .map(|(picture, place)| picture.candidates.get(place))
        .collect()
}

/// The candidate of each picture that is nearest to one of some picture.
fn nearest(pictures: &[&BlindReading], to: &Candidate) -> Vec<usize> {
    let distance = |candidate: &Candidate| {
        let part = if candidate.part == to.part { 0.0 } else { 1.0 };
        sweep::distance(&candidate.change, &to.change) + part
    };
    let place = |picture: &&BlindReading| {
        let distances = picture.candidates.iter().map(distance).enumerate();
        distances
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(0, |(place, _)| place)
    };
    pictures.iter().map(place).collect()
}

/// From these places each picture takes what makes the sum of all look most like a mark, until none does any more.
fn climbed(pictures: &[&BlindReading], mut places: Vec<usize>) -> Choice {
    let mut sum = vec![0.0_f32; pictures.iter().map(|picture| picture.bits).max().unwrap_or(0)];
    let add = |sum: &mut [f32], picture: usize, place: usize, sign: f32| {
        let candidate = pictures[picture].candidates.get(place);
        for (sum, v) in sum.iter_mut().zip(candidate.map_or(&[][..], |c| &c.logits)) {
            *sum += sign * v;
        }
    };
    // What a candidate costs by itself.
    let cost = |candidate: &Candidate| (score::of_logits(&candidate.logits) - candidate.score) / pictures.len() as f64;
    (0..pictures.len()).for_each(|picture| add(&mut sum, picture, places[picture], 1.0));
    let rounds = if pictures.len() > 1 { ROUNDS } else { 0 };
    for _ in 0..rounds {
        let before = places.clone();
        for (picture, read) in pictures.iter().enumerate() {
            add(&mut sum, picture, places[picture], -1.0);
            let scored = read.candidates.iter().enumerate().map(|(place, candidate)| {
                let with: Vec<f32> = sum.iter().zip(&candidate.logits).map(|(a, b)| a + b).collect();
                (place, score::of_logits(&with) - cost(candidate))
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
    let costs = pictures
        .iter()
        .zip(&places)
        .filter_map(|(picture, place)| picture.candidates.get(*place));
    Choice {
        score: score::of_logits(&sum) - costs.map(cost).sum::<f64>(),
        places,
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::extract::blind::Part;
    use crate::extract::photometric::ToneChange;

    const BITS: usize = 32;

    fn brightened(log: f32) -> ToneChange {
        ToneChange::of_gains([log; 3])
    }

    fn candidate(change: ToneChange, logits: Vec<f32>) -> Candidate {
        Candidate {
            part: Part::Whole,
            white: true,
            change,
            score: score::of_logits(&logits),
            logits,
        }
    }

    /// Of each picture some wrong candidates look better than the right one, which is no picture's best.
    #[test]
    fn what_was_done_to_all_pictures_is_found_where_each_alone_misleads() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut signs = || -> Vec<f32> { (0..BITS).map(|_| if rng.random() { 1.0 } else { -1.0 }).collect() };
        let message = signs();
        let pictures: Vec<BlindReading> = (0..5)
            .map(|picture| {
                let wrong = (1..8).map(|i| {
                    let logits = signs().into_iter().map(|v| 1.4 * v).collect();
                    candidate(brightened(-0.1 * i as f32 - 0.01 * picture as f32), logits)
                });
                let mut candidates: Vec<Candidate> = wrong.collect();
                candidates.push(candidate(brightened(0.05), message.clone()));
                BlindReading {
                    bits: BITS,
                    candidates,
                    is_clear: false,
                    windows: Vec::new(),
                }
            })
            .collect();
        let pictures: Vec<&BlindReading> = pictures.iter().collect();
        let own = climbed(&pictures, vec![0; 5]);
        assert!(
            own.places.iter().any(|place| *place != 7),
            "found without what is common"
        );
        assert!(chosen(&pictures).iter().all(|c| c.unwrap().change == brightened(0.05)));
        // One alone takes its best, and none of those that have none.
        assert_eq!(chosen(&pictures[..1])[0].unwrap(), &pictures[0].candidates[0]);
        let none = BlindReading {
            bits: BITS,
            candidates: Vec::new(),
            is_clear: false,
            windows: Vec::new(),
        };
        let found = chosen(&[&none, pictures[0]]);
        assert!(found[0].is_none() && found[1].is_some());
        assert!(chosen(&[]).is_empty());
    }
}
