//! Claims with wrong keys, read by a decoder as bad as decoders are: biased, and correlated between bits and views.
use guardsplat_codeword::{
    Claim, Code, HypothesisReading, Message, Payload, Scheme, Target, Whitening, chance, mark, signed_rank,
};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Bits of a coded word.
const BITS: usize = 64;
/// Views of a suspect. Two, so that all their bits together are as many as the binomial tail takes.
const VIEWS: usize = 2;
/// Hypotheses under which a suspect is read, where several are tried.
const HYPOTHESES: usize = 6;

/// How a p-value comes from what was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// As it should: logits summed over views, one test.
    OneTest,
    /// The same, with several hypotheses tried and counted.
    SeveralHypotheses,
    /// Wrongly: several hypotheses tried, and only the best counted.
    BestHypothesisOnly,
    /// Wrongly: each bit of each view as a trial of its own.
    ViewsAsTrials,
}

/// Claims with p at or below 10^-k, for k = 1 to 6.
pub type Counts = [u64; 6];

/// Runs so many claims. Every claim has a secret, an asset and a payload of its own, and a scene without its mark.
pub fn run(method: Method, claims: u64, seed: u64) -> Counts {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let decoder = Decoder::new(&mut rng);
    let mut counts = Counts::default();
    for _ in 0..claims {
        let p = p_value(method, &decoder, &mut rng);
        for (k, count) in (1..).zip(&mut counts) {
            *count += u64::from(p <= 10_f64.powi(-k));
        }
    }
    counts
}

/// The share of claims with p <= 10^-k that one test with one hypothesis has, exactly: the largest tail that is not above.
pub fn attainable(k: i32) -> f64 {
    let rate = 10_f64.powi(-k);
    let least = signed_rank::least(BITS as u32, rate, 1).ok().flatten();
    least.map_or(0.0, |least| signed_rank::tail(BITS as u32, least).unwrap_or(f64::NAN))
}

/// A share and its Wilson interval of 95 %, which is (0, 0.0000038) for none of a million.
pub fn interval(count: u64, claims: u64) -> (f64, f64) {
    let (n, z) = (claims as f64, 1.96_f64);
    let p = count as f64 / n;
    let centre = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 / (1.0 + z * z / n);
    (((centre - half) * scale).max(0.0), (centre + half) * scale)
}

/// What a decoder does to scenes without a mark.
struct Decoder {
    /// What it adds to each bit, whatever it sees.
    bias: Vec<f32>,
    /// How much each bit follows what all bits follow.
    loading: Vec<f32>,
}

impl Decoder {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let mut normals = |scale: f32| -> Vec<f32> { (0..BITS).map(|_| scale * normal(rng)).collect() };
        Self {
            bias: normals(1.5),
            loading: normals(1.0),
        }
    }

    /// Logits under one hypothesis, `[views][bits]`: bias, a factor of all bits, what is the scene's in each bit, and noise.
    fn read(&self, scene: &[f32], factor: f32, rng: &mut ChaCha8Rng) -> Vec<Vec<f32>> {
        let mut view = || {
            let factor = factor + 0.3 * normal(rng);
            let parts = self.bias.iter().zip(&self.loading).zip(scene);
            parts
                .map(|((bias, loading), own)| bias + loading * factor + own + 0.2 * normal(rng))
                .collect()
        };
        (0..VIEWS).map(|_| view()).collect()
    }
}

fn p_value(method: Method, decoder: &Decoder, rng: &mut ChaCha8Rng) -> f64 {
    let scene: Vec<f32> = (0..BITS).map(|_| 0.7 * normal(rng)).collect();
    let factor = normal(rng);
    let target = wrong_target(rng);
    let hypotheses = match method {
        Method::OneTest | Method::ViewsAsTrials => 1,
        Method::SeveralHypotheses | Method::BestHypothesisOnly => HYPOTHESES,
    };
    // Hypotheses differ by more than views: in what all bits follow, too.
    let mut readings = Vec::new();
    let mut agreeing = 0;
    for _ in 0..hypotheses {
        let views = decoder.read(&scene, factor + normal(rng), rng);
        let agrees = |view: &Vec<f32>| {
            target
                .word
                .bits()
                .zip(view)
                .filter(|&(bit, &logit)| bit == (logit > 0.0))
                .count()
        };
        agreeing += views.iter().map(agrees).sum::<usize>();
        let logits = (0..BITS).map(|bit| views.iter().map(|view| view[bit]).sum()).collect();
        readings.push(HypothesisReading {
            name: String::new(),
            views: VIEWS as u32,
            logits,
            tries: hypotheses as u64,
        });
    }
    if method == Method::ViewsAsTrials {
        return chance::tail((VIEWS * BITS) as u32, agreeing as u32).unwrap();
    }
    let claim = Claim {
        scheme: Scheme::default(),
        readings: &readings,
        targets: std::slice::from_ref(&target),
        targets_tried: None,
        other_tries: 1,
        rate: 1e-6,
    };
    let best = claim.test().unwrap().answer.best.unwrap();
    if method == Method::BestHypothesisOnly {
        best.p_alone
    } else {
        best.p_value
    }
}

/// The word of a mark that is not in the scene.
fn wrong_target(rng: &mut ChaCha8Rng) -> Target {
    let (mut secret, mut nonce) = ([0; 32], [0; 16]);
    rng.fill_bytes(&mut secret);
    rng.fill_bytes(&mut nonce);
    let whitening = Whitening {
        secret: &secret,
        asset: b"asset",
        nonce: &nonce,
    };
    let payload = Payload {
        key: 1,
        number: rng.random_range(0..1000),
    };
    let word: Message = mark(Code::default(), payload, &whitening).unwrap().word;
    Target {
        id: String::new(),
        word,
        pad: None,
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f32 {
    StandardNormal.sample(rng)
}
