//! Claims about marks: right ones from few and many views, also after what is done to pictures, and wrong ones.
//!
//! Both are made as the service makes them: pictures are read under every hypothesis, logits are summed over the views of a
//! claim, and [`guardsplat_codeword::Claim`] decides once.
use guardsplat_codeword::{
    Claim, Code, HypothesisReading, Message, NONCE_BYTES, Payload, ReadPayload, Reading, Scheme, Target, Whitening,
    chance, mark, shares,
};
use guardsplat_evaluation::attack::Attack;
use guardsplat_evaluation::report::names::{NONE, SCENE, UNMARKED};
use guardsplat_evaluation::report::record::{Claims, Id, POWERS, claims_id};
use guardsplat_evaluation::report::store::Store;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::read::Views;
use crate::error::{Error, Result};
use guardsplat_engine::extract::{Engine, PictureLogits, PooledLogits, hypotheses, read_given};
use guardsplat_engine::picture::Picture;

/// Views of a claim about pictures.
const POOLS: [usize; 3] = [1, 3, 10];
/// Wrong claims about each group of views.
const WRONG: u64 = 250;
/// What people do to a picture before they show it: screenshots at half the size, cropped, of a page that shows it, sent, and
/// some of that together.
const CHANGES: [&str; 8] = [
    "scale:0.5",
    "crop:0.8",
    "jpeg:75",
    "webp:75",
    "brightness:0.8..1.2",
    "border:0.1",
    "page:0.6",
    "crop:0.8+scale:0.75+jpeg:85",
];

/// What is looked at, and in how many ways.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Case {
    suspect: String,
    searched: bool,
    pools: Vec<usize>,
}

/// The mark that is looked for.
pub(super) struct ClaimTrials<'a> {
    pub engine: &'a Engine,
    pub message: &'a Message,
    pub mark: &'a Id,
    /// Side of the views in pixels.
    pub size: u32,
    pub seed: u64,
}

impl ClaimTrials<'_> {
    /// What the store does not have yet, of so many views.
    pub fn left(&self, store: &Store, views: usize) -> Vec<Case> {
        let case = |suspect: &str, searched, pools: &[usize]| Case {
            suspect: suspect.into(),
            searched,
            pools: pools.to_vec(),
        };
        let mut all = vec![case(SCENE, false, &[views])];
        for suspect in [NONE, UNMARKED] {
            all.extend([false, true].map(|searched| case(suspect, searched, &POOLS)));
        }
        all.extend(CHANGES.map(|change| case(change, true, &POOLS)));
        for case in &mut all {
            case.pools.retain(|pool| {
                let shape = (self.size, views as u32, *pool as u32);
                *pool <= views && !store.has(&claims_id(self.mark, &case.suspect, case.searched, shape))
            });
        }
        all.retain(|case| !case.pools.is_empty());
        all
    }

    /// Makes the claims of a case, a record for each number of views. `marked` are views of the mark, and `clean` renders
    /// them of the scene without it.
    pub fn carry_out(&self, case: &Case, marked: &Views, clean: impl FnOnce() -> Result<Views>) -> Result<Vec<Claims>> {
        let pictures = match case.suspect.as_str() {
            SCENE | NONE => marked.pictures()?,
            UNMARKED => clean()?.pictures()?,
            change => {
                let attack: Attack = change.parse().map_err(Error::Evaluation)?;
                marked.attacked(&attack, self.seed)?.pictures()?
            }
        };
        let suspects = pictures
            .iter()
            .map(|picture| Suspect::read(self.engine, picture, case.searched))
            .collect::<Result<Vec<_>>>()?;
        let pools = case.pools.iter();
        pools.map(|pool| self.claims(case, *pool, &suspects, WRONG)).collect()
    }

    /// The claim about the first pictures of views that this was done to, read together under every hypothesis; no wrong
    /// ones beside it.
    pub fn together(&self, suspect: &str, views: &Views, pictures: usize) -> Result<Claims> {
        let suspects = views
            .first(pictures)
            .iter()
            .map(|picture| Suspect::read(self.engine, picture, true))
            .collect::<Result<Vec<_>>>()?;
        let case = Case {
            suspect: suspect.into(),
            searched: true,
            pools: vec![pictures],
        };
        self.claims(&case, pictures, &suspects, 0)
    }

    fn claims(&self, case: &Case, pool: usize, suspects: &[Suspect], wrong: u64) -> Result<Claims> {
        let target = self.target()?;
        let mut claims = Claims {
            mark: self.mark.clone(),
            suspect: case.suspect.clone(),
            searched: case.searched,
            size: self.size,
            views: suspects.len() as u32,
            pool: pool as u32,
            framings: 1,
            rate: self.engine.false_positive_rate,
            p_values: Vec::new(),
            payloads: 0,
            wrong: 0,
            wrong_at_most: [0; POWERS],
            wrong_as_trials: (pool > 1 && wrong > 0).then_some([0; POWERS]),
        };
        // The same wrong claims whatever was read, and others for each group of views.
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x7772_6f6e_6700 ^ ((pool as u64) << 32));
        for views in suspects.chunks_exact(pool) {
            let readings = Suspect::readings(self.engine, views)?;
            claims.framings = claims.framings.max(readings.len() as u32);
            if case.suspect != UNMARKED {
                let (p, payload) = decide(&readings, &target, claims.rate)?;
                claims.p_values.push(p);
                claims.payloads += u32::from(payload);
            }
            for _ in 0..wrong {
                let wrong = wrong_target(&mut rng)?;
                count(&mut claims.wrong_at_most, decide(&readings, &wrong, claims.rate)?.0);
                if let (Some(counts), [first, second, ..]) = (&mut claims.wrong_as_trials, views) {
                    count(counts, as_trials(&[first, second], &wrong.word)?);
                }
                claims.wrong += 1;
            }
        }
        Ok(claims)
    }

    /// The message as the word of an asset: its pad is what makes a codeword of it.
    fn target(&self) -> Result<Target> {
        let word = *self.message;
        if !is_word(&word) {
            return Ok(Target {
                id: String::new(),
                word,
                pad: None,
            });
        }
        let payload = Payload {
            key: 1,
            number: self.seed as u32 & 0xffff,
        };
        let codeword = Code::default().codeword(payload).map_err(refused)?;
        Ok(Target {
            id: String::new(),
            word,
            pad: Some(word.xor(&codeword).map_err(refused)?),
        })
    }
}

/// One view, read.
enum Suspect {
    AsGiven(Vec<f32>),
    Searched(PictureLogits),
}

impl Suspect {
    fn read(engine: &Engine, picture: &Picture, searched: bool) -> Result<Self> {
        if searched {
            return Ok(Self::Searched(PictureLogits::read(engine, picture, None, &[])?));
        }
        Ok(Self::AsGiven(read_given(engine, picture)?))
    }

    fn as_given(&self) -> &[f32] {
        match self {
            Self::AsGiven(logits) => logits,
            Self::Searched(read) => read.as_given(),
        }
    }

    /// Logits summed over views, under each hypothesis.
    fn readings(engine: &Engine, views: &[Self]) -> Result<Vec<HypothesisReading>> {
        let searched: Vec<PictureLogits> = (views.iter())
            .filter_map(|view| match view {
                Self::Searched(read) => Some(read.clone()),
                Self::AsGiven(_) => None,
            })
            .collect();
        let reading = |(logits, tries): (Vec<f32>, u64)| HypothesisReading {
            name: String::new(),
            views: views.len() as u32,
            logits,
            tries,
        };
        if searched.is_empty() {
            let given = views.iter().map(|view| view.as_given().to_vec()).collect();
            return Ok(vec![reading((PooledLogits::new(given)?.summed, 1))]);
        }
        let (read, logits): (Vec<_>, Vec<_>) = hypotheses(engine, &searched)?.into_iter().unzip();
        let logits = logits.into_iter().map(|logits| logits.summed);
        Ok(logits.zip(shares(&read)).map(reading).collect())
    }
}

/// Whether a message is as long as the words that assets are marked with.
fn is_word(message: &Message) -> bool {
    message.length() == Scheme::default().length()
}

/// The p-value of a claim, and whether the payload was read as it is registered.
fn decide(readings: &[HypothesisReading], target: &Target, rate: f64) -> Result<(f64, bool)> {
    let claim = Claim {
        scheme: match is_word(&target.word) {
            true => Scheme::default(),
            false => Scheme::Raw {
                bits: target.word.length(),
            },
        },
        readings,
        targets: std::slice::from_ref(target),
        targets_tried: None,
        other_tries: 1,
        rate,
    };
    let answer = claim.test().map_err(refused)?.answer;
    let payload = matches!(
        answer.payload,
        Some(ReadPayload::Read {
            as_registered: true,
            ..
        })
    );
    Ok((answer.best.map_or(1.0, |best| best.p_value), payload))
}

/// What the p-value would be if the bits of these views were trials of their own: wrong, and measured to show it.
fn as_trials(views: &[&Suspect], word: &Message) -> Result<f64> {
    let agreeing = |view: &&Suspect| Reading::from_logits(view.as_given())?.matches(word);
    let agreeing: guardsplat_codeword::Result<u32> = views.iter().map(agreeing).sum();
    let bits = word.length().bits() * views.len() as u32;
    chance::tail(bits, agreeing.map_err(refused)?).map_err(refused)
}

fn count(counts: &mut [u64; POWERS], p: f64) {
    for (count, k) in counts.iter_mut().zip(1..) {
        *count += u64::from(p <= 10_f64.powi(-k));
    }
}

/// The word of another owner's asset.
fn wrong_target(rng: &mut ChaCha8Rng) -> Result<Target> {
    let (mut secret, mut nonce) = ([0; 32], [0; NONCE_BYTES]);
    rng.fill_bytes(&mut secret);
    rng.fill_bytes(&mut nonce);
    let whitening = Whitening {
        secret: &secret,
        asset: b"asset",
        nonce: &nonce,
    };
    let payload = Payload {
        key: rng.random_range(0..1000),
        number: rng.random_range(0..100_000),
    };
    Ok(Target {
        id: String::new(),
        word: mark(Code::default(), payload, &whitening).map_err(refused)?.word,
        pad: None,
    })
}

fn refused(error: guardsplat_codeword::Error) -> Error {
    Error::bad_option("claims", error.to_string())
}

#[cfg(test)]
mod tests {
    use guardsplat_codeword::DEFAULT_FALSE_POSITIVE_RATE;

    use super::*;

    /// A reading whose logits say `word`, but for the first `wrong` bits, which have the lowest ranks.
    fn reading(word: &Message, wrong: usize) -> HypothesisReading {
        let logits = word
            .bits()
            .enumerate()
            .map(|(i, bit)| if bit == (i >= wrong) { 1.0 } else { -1.0 });
        HypothesisReading {
            name: String::new(),
            views: 1,
            logits: logits.collect(),
            tries: 1,
        }
    }

    #[test]
    fn right_claims_pay_for_their_hypotheses_and_read_the_payload() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let word = Message::random(64, &mut rng).unwrap();
        let codeword = Code::default().codeword(Payload { key: 1, number: 5 }).unwrap();
        let target = Target {
            id: String::new(),
            word,
            pad: Some(word.xor(&codeword).unwrap()),
        };
        let (one, read) = decide(&[reading(&word, 4)], &target, DEFAULT_FALSE_POSITIVE_RATE).unwrap();
        assert!(read && one < 1e-9, "{one}");
        let (two, _) = decide(
            &[reading(&word, 32), reading(&word, 4)].map(|reading| HypothesisReading { tries: 2, ..reading }),
            &target,
            DEFAULT_FALSE_POSITIVE_RATE,
        )
        .unwrap();
        assert_eq!(two, 2.0 * one);
        let (none, read) = decide(&[reading(&word, 46)], &target, DEFAULT_FALSE_POSITIVE_RATE).unwrap();
        // Half of the rank sum.
        assert!(!read && none > 0.4);
    }

    #[test]
    fn wrong_claims_have_the_p_values_that_they_should_and_views_as_trials_have_not() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        // Two views that say the same, as views of one scene do.
        let word = wrong_target(&mut rng).unwrap().word;
        let view = || Suspect::AsGiven(reading(&word, 0).logits);
        let (first, second) = (view(), view());
        let (mut right, mut wrong) = ([0; POWERS], [0; POWERS]);
        for _ in 0..20_000 {
            let target = wrong_target(&mut rng).unwrap();
            count(
                &mut right,
                decide(&[reading(&word, 0)], &target, DEFAULT_FALSE_POSITIVE_RATE)
                    .unwrap()
                    .0,
            );
            count(&mut wrong, as_trials(&[&first, &second], &target.word).unwrap());
        }
        // Almost exactly 0.01 at 10^-2, so 200 with a deviation of 14.
        assert!((140..=260).contains(&right[1]), "{right:?}");
        assert!(wrong[1] > 3 * right[1] && wrong[3] > 20, "{wrong:?}");
    }
}
