//! What a verification finds: reads scenes and pictures, and says whether the message is there.
use guardsplat_codeword::{Hypothesis, Message, Verdict, shares};
use guardsplat_engine::Result;
use guardsplat_engine::extract::{
    Comparison, Engine, PictureLogits, PooledLogits, StaticBackground, default_size, estimates, hypotheses, read_given,
    read_scene, size_for_scene,
};
use guardsplat_engine::memory::{MemoryRequirements, admission, picture_bytes};
use guardsplat_engine::picture::Picture;
use guardsplat_engine::scene::{BadRows, Ignored, Scene};
use guardsplat_engine::splat::Geometry;
use guardsplat_engine::view::{Camera, SceneKind, ViewSampler, Viewpoints};

use crate::suspect::Suspect;
use crate::thumbnails::Thumbnails;

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
    /// Where the scene's viewers are; where none are given the kind of scene says where.
    pub cameras: Vec<Camera>,
    /// That kind; found from the scene where none is given.
    pub kind: Option<SceneKind>,
    /// What becomes of rows of the scene with values that are not legal.
    pub bad_rows: BadRows,
    /// Whether scenes may be in more files than one: where their user chose them on this machine.
    pub with_files: bool,
    /// The level of detail of streamed scenes that is read, 0 being the finest. For such files as were chosen on this machine.
    pub level: usize,
}

/// What is told of a picture whose static background was taken out, after what is estimated to have been done to it.
const WITHOUT_BACKGROUND: &str = ", without what other pictures show, too";

/// Logits of views or pictures.
type Logits = Vec<Vec<f32>>;

/// Reads all scenes and pictures of `suspect` together, and tells of rows of scenes that were ignored; `shown` keeps the first
/// pictures, and `progress` hears how many views and pictures are done, and of how many.
pub fn read(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    shown: &mut Thumbnails,
    mut progress: impl FnMut(usize, usize),
) -> Result<(PooledLogits, Vec<Ignored>)> {
    let (mut logits, ignored) = read_scenes(engine, suspect, views, shown, &mut progress)?;
    let (before, total) = (logits.len(), count(suspect, views));
    // One at a time: thousands of large pictures need not fit in memory.
    for (index, picture) in suspect.pictures.iter().enumerate() {
        let picture = picture.pixels(views.background)?;
        shown.see("picture", index, &picture)?;
        logits.push(read_given(engine, picture.as_ref())?);
        progress(before + index + 1, total);
    }
    Ok((PooledLogits::new(logits)?, ignored))
}

/// Views and pictures that are read.
fn count(suspect: &Suspect, views: &Views) -> usize {
    suspect.scenes.len() * views.count + suspect.pictures.len()
}

fn read_scenes(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    shown: &mut Thumbnails,
    progress: &mut impl FnMut(usize, usize),
) -> Result<(Logits, Vec<Ignored>)> {
    let (mut logits, mut ignored) = (Logits::new(), Vec::new());
    let total = count(suspect, views);
    for path in &suspect.scenes {
        // A scene of fine splats is drawn at twice the side, and is not read yet.
        let largest = views.size.unwrap_or_else(|| 2 * default_size(engine));
        let rest = MemoryRequirements {
            models: engine.model_bytes(false),
            pictures: picture_bytes(largest, largest),
            ..MemoryRequirements::of_program()
        };
        admission::admit_reading(path, &engine.limits, rest)?;
        let memory = engine.limits.left(&rest);
        let scene = match views.with_files {
            true => Scene::read_level(path, views.level, views.bad_rows, memory)?,
            false => Scene::read_within(path, views.bad_rows, memory)?,
        };
        ignored.extend(scene.ignored().cloned());
        let gaussians = scene.into_gaussians();
        let before = logits.len();
        let seen = |done: usize, picture: &Picture| {
            progress(before + done, total);
            shown.see("view", before + done - 1, picture)
        };
        let viewpoints = Viewpoints {
            kind: views.kind,
            cameras: &views.cameras,
        };
        let sampler = ViewSampler::seen_from(&gaussians, views.seed, viewpoints)?;
        let size = match views.size {
            Some(size) => size,
            None => size_for_scene(engine, &Geometry::new(&gaussians), &sampler)?,
        };
        let reading = read_scene(engine, &gaussians, &sampler, views.count, size, views.background, seen)?;
        logits.extend(reading.views);
    }
    Ok((logits, ignored))
}

/// What was read under every hypothesis.
pub struct HypothesisReadings {
    /// A reading under each, as given first.
    pub readings: Vec<(Hypothesis, PooledLogits)>,
    /// What is estimated to have been done to each picture, in words, where that is how the engine reads.
    pub estimates: Vec<String>,
    /// Rows of scenes that were ignored.
    pub ignored: Vec<Ignored>,
}

/// As [`read`], under every hypothesis about what was done to pictures; views of scenes are as they are under all of them,
/// and without pictures there is one only. Those without borders are there only if some picture has any: others would be
/// the same once more.
pub fn read_hypotheses(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    shown: &mut Thumbnails,
    mut progress: impl FnMut(usize, usize),
) -> Result<HypothesisReadings> {
    let (of_scenes, ignored) = read_scenes(engine, suspect, views, shown, &mut progress)?;
    if suspect.pictures.is_empty() {
        return Ok(HypothesisReadings {
            readings: vec![(Hypothesis::default(), PooledLogits::new(of_scenes)?)],
            estimates: Vec::new(),
            ignored,
        });
    }
    let mut background = StaticBackground::default();
    for place in StaticBackground::places(suspect.pictures.len()) {
        background.add(place, suspect.pictures[place].pixels(views.background)?.as_ref());
    }
    let mut pictures = Vec::with_capacity(suspect.pictures.len());
    let mut notes = Vec::with_capacity(suspect.pictures.len());
    for (index, picture) in suspect.pictures.iter().enumerate() {
        let picture = picture.pixels(views.background)?;
        shown.see("picture", index, &picture)?;
        let moving = background.taken_out(index, &picture);
        let read = PictureLogits::read(engine, &picture, moving.as_ref(), &pictures)?;
        pictures.push(read);
        notes.push(if moving.is_some() { WITHOUT_BACKGROUND } else { "" });
        progress(of_scenes.len() + index + 1, count(suspect, views));
    }
    let together = |(hypothesis, logits): (Hypothesis, PooledLogits)| {
        let all = of_scenes.iter().cloned().chain(logits.views).collect();
        Ok((hypothesis, PooledLogits::new(all)?))
    };
    let read = hypotheses(engine, &pictures)?.into_iter().map(together);
    Ok(HypothesisReadings {
        readings: read.collect::<Result<_>>()?,
        estimates: estimates(&pictures)
            .into_iter()
            .zip(notes)
            .filter_map(|(estimate, note)| Some(format!("{}{note}", estimate?)))
            .collect(),
        ignored,
    })
}

/// What was read, and how it compares with a raw message.
pub struct Compared {
    /// What was read under the hypothesis that agrees best.
    pub reading: PooledLogits,
    /// How it compares, if there is a message, or a coded one is read.
    pub comparison: Option<Comparison>,
    /// What was undone for it.
    pub hypothesis: Hypothesis,
    /// Hypotheses under which the pictures were read.
    pub hypotheses: usize,
    /// What is estimated to have been done to each picture, in words, if it was estimated.
    pub estimates: Vec<String>,
    /// Rows of scenes that were ignored.
    pub ignored: Vec<Ignored>,
}

/// Reads `suspect` and compares it with `message`. Pictures that do not match as they are given are read under every other
/// hypothesis besides, and so are those of a message that is too short to match, unless all of it is right. Each hypothesis
/// pays by its share of the rate ([`shares`]): half is for pictures as they are, so that those who change nothing hardly pay
/// for those who do. Without a message a coded one is compared with what it reads itself, and pays for all messages.
pub fn read_and_compare(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    message: Option<&Message>,
    mut progress: impl FnMut(usize, usize),
) -> Result<Compared> {
    // Nobody looks at what was compared with a raw message.
    let mut shown = Thumbnails::default();
    let (reading, ignored) = read(engine, suspect, views, &mut shown, &mut progress)?;
    let mut best = Compared {
        reading,
        comparison: None,
        hypothesis: Hypothesis::default(),
        hypotheses: 1,
        estimates: Vec::new(),
        ignored,
    };
    let compare = |reading: &PooledLogits, tries: u64| {
        let code = &engine.message_code;
        let (message, tries) = match (message, code.messages()) {
            (Some(message), _) => (*message, tries),
            (None, Some(messages)) => (code.read(&reading.summed)?, tries.saturating_mul(messages)),
            (None, None) => return Ok(None),
        };
        reading
            .compare(code, &message, &engine.acceptance_rule(tries as usize))
            .map(Some)
    };
    // Without pictures there is nothing to guess. With them the first reading has what it would have among all.
    let given = if suspect.pictures.is_empty() { 1 } else { 2 };
    let Some(as_given) = compare(&best.reading, given)? else {
        return Ok(best);
    };
    // Of a message that is too short for a match the best reading is told all the same.
    let all = as_given.decision.matched_bits == as_given.decision.bits;
    let decided = given == 1 || all || as_given.decision.verdict == Verdict::Match;
    let mut p_value = as_given.decision.p_value;
    best.comparison = Some(as_given);
    if decided {
        return Ok(best);
    }
    let HypothesisReadings {
        readings: read,
        estimates,
        ..
    } = read_hypotheses(engine, suspect, views, &mut shown, progress)?;
    (best.hypotheses, best.estimates) = (read.len(), estimates);
    let tries = shares(&read.iter().map(|(hypothesis, _)| *hypothesis).collect::<Vec<_>>());
    for ((hypothesis, reading), tries) in read.into_iter().zip(tries).skip(1) {
        if let Some(comparison) = compare(&reading, tries)?.filter(|found| found.decision.p_value < p_value) {
            p_value = comparison.decision.p_value;
            (best.reading, best.hypothesis, best.comparison) = (reading, hypothesis, Some(comparison));
        }
    }
    Ok(best)
}
