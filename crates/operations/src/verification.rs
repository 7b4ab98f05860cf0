//! What a verification reads of scenes and pictures, as they are and under every hypothesis.
use std::path::Path;

use guardsplat_codeword::Hypothesis;
use guardsplat_engine::Result;
use guardsplat_engine::extract::{
    Engine, PictureLogits, PooledLogits, StaticBackground, default_size, estimates, hypotheses, read_given, read_scene,
    size_for_scene,
};
use guardsplat_engine::memory::{MemoryRequirements, admission, picture_bytes};
use guardsplat_engine::picture::Picture;
use guardsplat_engine::scene::{BadRows, Gaussians, Ignored, Scene};
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

impl Views {
    /// Where the viewers of a scene are.
    pub(crate) fn sampler(&self, gaussians: &Gaussians) -> Result<ViewSampler> {
        let viewpoints = Viewpoints {
            kind: self.kind,
            cameras: &self.cameras,
        };
        ViewSampler::seen_from(gaussians, self.seed, viewpoints)
    }
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
        let scene = loaded(engine, path, views, picture_bytes(largest, largest))?;
        ignored.extend(scene.ignored().cloned());
        let gaussians = scene.into_gaussians();
        let before = logits.len();
        let seen = |done: usize, picture: &Picture| {
            progress(before + done, total);
            shown.see("view", before + done - 1, picture)
        };
        let sampler = views.sampler(&gaussians)?;
        let size = match views.size {
            Some(size) => size,
            None => size_for_scene(engine, &Geometry::new(&gaussians), &sampler)?,
        };
        let reading = read_scene(engine, &gaussians, &sampler, views.count, size, views.background, seen)?;
        logits.extend(reading.views);
    }
    Ok((logits, ignored))
}

/// A scene of the suspect or the original, if memory has room for it beside pictures of so many bytes.
pub(crate) fn loaded(engine: &Engine, path: &Path, views: &Views, pictures: u64) -> Result<Scene> {
    let rest = MemoryRequirements {
        models: engine.model_bytes(false),
        pictures,
        ..MemoryRequirements::of_program()
    };
    admission::admit_reading(path, &engine.limits, rest)?;
    let memory = engine.limits.left(&rest);
    Ok(match views.with_files {
        true => Scene::read_level(path, views.level, views.bad_rows, memory)?,
        false => Scene::read_within(path, views.bad_rows, memory)?,
    })
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
