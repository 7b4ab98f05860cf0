//! What a verification finds: reads a scene or pictures, and says whether the message is there.
use guardsplat_worker::Result;
use guardsplat_worker::admission::{self, picture_bytes};
use guardsplat_worker::extract::{
    Comparison, Engine, Framing, Reading, Source, default_size, read_scene, without_borders,
};
use guardsplat_worker::memory::Memory;
use guardsplat_worker::message::Verdict;
use guardsplat_worker::quality::read_picture;
use guardsplat_worker::scene::{BadRows, Ignored, Scene};
use serde::Serialize;

/// Why a reading that has nothing to be compared with decides nothing.
const NOTHING_TO_COMPARE: &str = "any scene reads as some message; one to compare with decides";

/// From where a scene is read.
pub struct Views {
    /// How many views.
    pub count: usize,
    /// Their side in pixels; what CLIP takes in unless given.
    pub size: Option<u32>,
    /// What is behind the scene, or shows through transparent pixels of pictures.
    pub background: [f32; 3],
    /// Decides them.
    pub seed: u64,
    /// What becomes of rows of the scene with values that are not legal.
    pub bad_rows: BadRows,
}

/// Reads `source`, and tells of rows of a scene that were ignored; `progress` hears how many views or pictures are done,
/// and of how many.
pub fn read(
    engine: &Engine,
    source: &Source,
    views: &Views,
    mut progress: impl FnMut(usize, usize),
) -> Result<(Reading, Option<Ignored>)> {
    match source {
        Source::Scene(path) => {
            let size = views.size.unwrap_or_else(|| default_size(engine));
            let rest = Memory {
                models: engine.model_bytes(false),
                pictures: picture_bytes(size, size),
                ..Memory::of_program()
            };
            admission::to_read(path, &engine.limits, rest)?;
            let scene = Scene::read_with(path, views.bad_rows)?;
            let ignored = scene.ignored().cloned();
            let gaussians = scene.into_gaussians();
            let reading = read_scene(
                engine,
                &gaussians,
                views.count,
                size,
                views.background,
                views.seed,
                |done| {
                    progress(done, views.count);
                },
            )?;
            Ok((reading, ignored))
        }
        Source::Pictures(paths) => {
            let mut read = Vec::with_capacity(paths.len());
            // One at a time: thousands of large pictures need not fit in memory.
            for (index, path) in paths.iter().enumerate() {
                let picture = read_picture(path, views.background)?;
                read.extend(engine.read_logits(&[picture])?);
                progress(index + 1, paths.len());
            }
            Ok((Reading::new(read)?, None))
        }
    }
}

/// A reading in each framing, as given first, and rows of a scene that were ignored.
pub type Framed = (Vec<(Framing, Reading)>, Option<Ignored>);

/// As [`read`], in every framing that pictures may be in; a scene is rendered as it is, and has one only. Framings
/// without borders are there only if some picture has any: others would be the same once more.
pub fn read_framed(
    engine: &Engine,
    source: &Source,
    views: &Views,
    mut progress: impl FnMut(usize, usize),
) -> Result<Framed> {
    let Source::Pictures(paths) = source else {
        let (reading, ignored) = read(engine, source, views, progress)?;
        return Ok((vec![(Framing::default(), reading)], ignored));
    };
    let framings: Vec<Framing> = [false, true].into_iter().flat_map(Framing::laid).collect();
    let laid = framings.len() / 2;
    let mut logits: Vec<Vec<Vec<f32>>> = vec![Vec::with_capacity(paths.len()); framings.len()];
    let mut borders = false;
    for (index, path) in paths.iter().enumerate() {
        let picture = read_picture(path, views.background)?;
        let trimmed = without_borders(&picture);
        borders |= trimmed.is_some();
        // One at a time: a large picture need not fit in memory eight times.
        for (place, framing) in framings.iter().enumerate() {
            let read = match (&trimmed, framing.trimmed) {
                (Some(trimmed), true) => engine.read_logits(&[framing.lay(trimmed)])?,
                (None, true) => vec![logits[place - laid][index].clone()],
                (_, false) => engine.read_logits(&[framing.lay(&picture)])?,
            };
            logits[place].extend(read);
        }
        progress(index + 1, paths.len());
    }
    let read = framings.into_iter().zip(logits);
    let tried = read.filter(|(framing, _)| borders || !framing.trimmed);
    let readings = tried.map(|(framing, logits)| Ok((framing, Reading::new(logits)?)));
    Ok((readings.collect::<Result<_>>()?, None))
}

/// The outcome, with the names of the program's JSON.
#[derive(Serialize)]
pub struct Findings {
    /// Whether the message is there.
    pub verdict: Verdict,
    /// Probability that as many bits match by chance.
    pub p_value: Option<f64>,
    /// A match needs a p-value at or below this.
    pub threshold: Option<f64>,
    /// Bits that match.
    pub matched_bits: Option<u32>,
    /// Matches that the verdict needs.
    pub needed_bits: Option<u32>,
    /// Bits compared.
    pub bits: usize,
    /// Views or pictures read.
    pub views: usize,
    /// The message read.
    pub message: String,
    /// Mean share of bits of a view that match.
    pub bit_accuracy: Option<f64>,
    /// The same of the worst view.
    pub bit_accuracy_worst_view: Option<f64>,
    /// Mean distance of the bits' logits from the threshold.
    pub mean_abs_logit: f64,
    /// Mean share of views that agree with the decision on a bit.
    pub view_agreement: f64,
    /// Rows of the scene that are no Gaussians of it and were ignored.
    pub ignored_rows: usize,
    /// Why nothing could be decided.
    pub reason: Option<String>,
}

impl Findings {
    /// What a reading and its comparison with a claimed message, if there was one, say; and how many rows of the scene
    /// were ignored for it.
    pub fn new(reading: &Reading, comparison: Option<&Comparison>, ignored: Option<&Ignored>) -> Result<Self> {
        let decision = comparison.map(|c| &c.decision);
        Ok(Self {
            verdict: decision.map_or(Verdict::Inconclusive, |d| d.verdict),
            p_value: decision.map(|d| d.p_value),
            threshold: decision.map(|d| d.threshold),
            matched_bits: decision.map(|d| d.matched_bits),
            needed_bits: decision.and_then(|d| d.needed_bits),
            bits: reading.summed.len(),
            views: reading.views.len(),
            message: reading.message()?.to_string(),
            bit_accuracy: comparison.map(|c| c.bit_accuracy),
            bit_accuracy_worst_view: comparison.map(|c| c.bit_accuracy_worst_view),
            mean_abs_logit: reading.mean_abs_logit(),
            view_agreement: reading.agreement(),
            ignored_rows: ignored.map_or(0, Ignored::count),
            reason: match decision {
                Some(decision) => decision.reason.clone(),
                None => Some(NOTHING_TO_COMPARE.into()),
            },
        })
    }
}
