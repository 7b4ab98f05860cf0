//! Readings of several pictures of which one leads: what was done to it is guessed, and each of the others is read in the
//! way that agrees best with it.
//!
//! People change every picture in its own way, so one guess about all of them seldom fits, and the right one of all
//! combinations would have to be paid for by their number. But pictures of one scene carry one message. Where the guess
//! about the leader is right, the right reading of another picture has nearly all bits in common with it, and a wrong one
//! about half. Where it is wrong, whatever follows is as wrong, and only its share of the rate is lost. No claim has a say
//! in it, so a reading for each guess is all that is paid for.
use guardsplat_codeword::Hypothesis;
use rayon::prelude::*;

/// Most readings. All bits of 32 are to be a match at one in a million, with an eighth of the rate for all of these.
const MOST: usize = 512;
/// Most pictures of which one leads. Each reading holds logits of all of them.
const MOST_PICTURES: usize = 64;

/// All ways in which a picture was read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ways<'a> {
    /// Those that it may lead with, as given first; it may follow with them, too.
    pub leading: Vec<(Hypothesis, &'a [f32])>,
    /// Others that it may follow with.
    pub following: Vec<&'a [f32]>,
}

/// A reading of all pictures.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Led<'a> {
    /// What is undone of the leader.
    pub hypothesis: Hypothesis,
    /// Logits of each picture.
    pub logits: Vec<&'a [f32]>,
}

impl<'a> Ways<'a> {
    /// Logits of each.
    fn all(&self) -> impl Iterator<Item = &'a [f32]> {
        self.leading
            .iter()
            .map(|(_, logits)| *logits)
            .chain(self.following.iter().copied())
    }
}

/// A reading for each way of each leader: as many pictures lead, the first ones, as there may be readings. None of a single
/// picture.
pub(super) fn readings<'a>(pictures: &[Ways<'a>]) -> Vec<Led<'a>> {
    if !(2..=MOST_PICTURES).contains(&pictures.len()) {
        return Vec::new();
    }
    let compared: Vec<Vec<Vec<f32>>> = pictures
        .iter()
        .map(|ways| ways.all().map(direction).collect())
        .collect();
    let mut led = Vec::new();
    for (leader, ways) in pictures.iter().enumerate() {
        if led.len() + ways.leading.len() > MOST {
            break;
        }
        led.par_extend(ways.leading.par_iter().enumerate().map(|(way, (hypothesis, logits))| {
            let followed = |(picture, ways): (usize, &Ways<'a>)| match picture == leader {
                true => Some(*logits),
                false => ways.all().nth(nearest(&compared[picture], &compared[leader][way])),
            };
            Led {
                hypothesis: Hypothesis {
                    leader: Some(1 + leader as u32),
                    ..*hypothesis
                },
                logits: pictures.iter().enumerate().filter_map(followed).collect(),
            }
        }));
    }
    led
}

/// The place of what agrees best, the first of equal ones.
fn nearest(directions: &[Vec<f32>], with: &[f32]) -> usize {
    let agreement = |direction: &Vec<f32>| direction.iter().zip(with).map(|(a, b)| a * b).sum::<f32>();
    let agreements = directions.iter().map(agreement).enumerate();
    let best = agreements.fold(
        (0, f32::NEG_INFINITY),
        |best, now| if now.1 > best.1 { now } else { best },
    );
    best.0
}

/// What is compared of logits: their roots, so that a few large ones do not decide, at length 1.
fn direction(logits: &[f32]) -> Vec<f32> {
    let roots: Vec<f32> = logits.iter().map(|v| v.signum() * v.abs().sqrt()).collect();
    let length = roots.iter().map(|v| v * v).sum::<f32>().sqrt();
    roots.into_iter().map(|v| v / length.max(f32::MIN_POSITIVE)).collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const BITS: usize = 64;

    /// Random logits of one size.
    fn random(rng: &mut ChaCha8Rng) -> Vec<f32> {
        (0..BITS).map(|_| if rng.random() { 1.0 } else { -1.0 }).collect()
    }

    /// The message with so many bits wrong.
    fn misread(message: &[f32], wrong: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let mut read = message.to_vec();
        for place in rand::seq::index::sample(rng, BITS, wrong) {
            read[place] = -read[place];
        }
        read
    }

    fn matches(logits: &[&[f32]], message: &[f32]) -> usize {
        let sum = |bit: usize| logits.iter().map(|l| l[bit]).sum::<f32>();
        (0..BITS).filter(|bit| sum(*bit) * message[*bit] > 0.0).count()
    }

    fn ways(leading: &[Vec<f32>], following: &[Vec<f32>]) -> Ways<'static> {
        let kept = |logits: &Vec<f32>| -> &'static [f32] { logits.clone().leak() };
        Ways {
            leading: leading
                .iter()
                .map(|logits| (Hypothesis::default(), kept(logits)))
                .collect(),
            following: following.iter().map(kept).collect(),
        }
    }

    /// Each picture has one right way, another one for each, that reads an eighth of the bits wrong.
    #[test]
    fn pictures_that_were_changed_differently_are_read_together() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let message = random(&mut rng);
        let pictures: Vec<Ways<'_>> = (0..3)
            .map(|picture| {
                let mut leading: Vec<_> = (0..100).map(|_| random(&mut rng)).collect();
                let mut following: Vec<_> = (0..100).map(|_| random(&mut rng)).collect();
                let right = misread(&message, BITS / 8, &mut rng);
                // The last can't lead with what is right.
                match picture {
                    2 => following[40] = right,
                    _ => leading[10 + picture] = right,
                }
                ways(&leading, &following)
            })
            .collect();
        let led = readings(&pictures);
        assert_eq!(led.len(), 300);
        let of = |leader: u32| {
            let led = led.iter().filter(|led| led.hypothesis.leader == Some(leader));
            led.map(|led| matches(&led.logits, &message)).max().unwrap()
        };
        assert!(of(1) >= BITS - 4 && of(2) >= BITS - 4, "{} {}", of(1), of(2));
        assert!(of(3) < 50, "{}", of(3));
        // Words that nobody marked are matched as by any hundreds of readings: by 46 to 48 of 64 bits at best.
        for _ in 0..20 {
            let other = random(&mut rng);
            let best = led.iter().map(|led| matches(&led.logits, &other)).max().unwrap();
            assert!(best < 52, "{best}");
        }
    }

    #[test]
    fn a_picture_that_is_clear_leads_with_what_is_estimated() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let message = random(&mut rng);
        let clear = ways(&[misread(&message, 2, &mut rng)], &[]);
        let mut leading: Vec<_> = (0..600).map(|_| random(&mut rng)).collect();
        leading[500] = misread(&message, 10, &mut rng);
        let led = readings(&[clear.clone(), ways(&leading, &[])]);
        // The second has more ways than there may be readings.
        assert_eq!(led.len(), 1);
        assert_eq!(led[0].logits[1], leading[500].as_slice());
        assert_eq!(led[0].hypothesis.leader, Some(1));
        assert!(readings(std::slice::from_ref(&clear)).is_empty() && readings(&[]).is_empty());
        assert!(readings(&vec![clear; MOST_PICTURES + 1]).is_empty());
    }
}
