//! What detectors without a key make of marks: views of unmarked and marked scenes, side by side.
use std::path::{Path, PathBuf};

use guardsplat_evaluation::report::names::CONTROL;
use guardsplat_evaluation::report::record::{Detection, Id, Record, detection_id};
use guardsplat_evaluation::report::store::Store;
use guardsplat_evaluation::steganalysis::control::replace_bits;
use guardsplat_evaluation::steganalysis::{DetectorInputs, Pairs, Steganalyzer, judge};

use super::mark::path;
use super::read::{Views, cameras};
use super::run::Options;
use crate::error::{Error, Result};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::scene::Scene;

/// Share of samples whose last bits are replaced in the positive control.
const CONTROL_RATE: f64 = 0.5;
/// Seed that records carry; those of the learned detector are fixed.
const SEED: u64 = 1;

/// A mark that is judged.
pub(super) struct Marked {
    pub scene: PathBuf,
    pub name: String,
    pub seed: u64,
    pub id: Id,
}

/// One detector on marks, or on its positive control.
struct WantedDetection {
    judge: Steganalyzer,
    control: bool,
    name: String,
}

/// Marks of one length, all of the same variant.
pub(super) struct SteganalysisRun<'a> {
    pub marks: &'a [Marked],
    pub options: &'a Options,
}

impl SteganalysisRun<'_> {
    /// Has the detectors look at what they have not yet; `engine` is only asked for if there is anything.
    pub fn carry_out(
        &self,
        store: &mut Store,
        engine: impl FnOnce() -> Result<Engine>,
        mut progress: impl FnMut(String, f64),
    ) -> Result<()> {
        let scenes = self.scenes();
        let marks: Vec<Id> = self.marks.iter().map(|mark| mark.id.clone()).collect();
        let views = Some(self.options.views as u32);
        let pairs: Vec<usize> = (scenes.iter())
            .map(|scene| self.options.views * self.marks.iter().filter(|mark| mark.name == *scene).count())
            .collect();
        let wanted: Vec<WantedDetection> = [false, true]
            .into_iter()
            .flat_map(|control| Steganalyzer::ALL.map(|judge| WantedDetection::new(judge, control)))
            .filter(|wanted| wanted.judge.can_detect(&pairs).is_ok())
            .filter(|wanted| !store.has(&detection_id(&wanted.name, &scenes, &marks, SEED, views)))
            .collect();
        if wanted.is_empty() {
            return Ok(());
        }
        let [of_marks, of_controls] = self.look(&scenes, &engine()?, store.folder())?;
        for wanted in wanted {
            let pairs = if wanted.control { &of_controls } else { &of_marks };
            let verdict = judge(wanted.judge, pairs).map_err(Error::Evaluation)?;
            progress(wanted.name.clone(), verdict.area);
            let detection = Detection {
                detector: wanted.name,
                scenes: scenes.clone(),
                marks: marks.clone(),
                seed: SEED,
                views,
                clean: verdict.clean,
                marked: verdict.suspicious,
                auc: verdict.area,
                auc_interval: verdict.interval,
                clusters: verdict.clusters.map(|clusters| clusters as u32),
            };
            store.append(Record::Detection(detection)).map_err(Error::Evaluation)?;
        }
        Ok(())
    }

    /// Names of the scenes, in the order of their first marks.
    fn scenes(&self) -> Vec<String> {
        let mut scenes: Vec<String> = Vec::new();
        for mark in self.marks {
            if !scenes.contains(&mark.name) {
                scenes.push(mark.name.clone());
            }
        }
        scenes
    }

    /// Renders all views and looks at them, a mark at a time: pictures of all would not fit. Of marks and of controls.
    fn look(&self, scenes: &[String], engine: &Engine, folder: &Path) -> Result<[Vec<Pairs>; 2]> {
        let mut of_marks = vec![Pairs::default(); scenes.len()];
        let mut of_controls = of_marks.clone();
        for mark in self.marks {
            let Some(place) = scenes.iter().position(|scene| *scene == mark.name) else {
                continue;
            };
            engine.stop.check()?;
            let scene = Scene::read(&mark.scene)?;
            let cameras = cameras(&scene.gaussians, 0..self.options.views, self.options.size, mark.seed)?;
            let clean = Views::render(engine, &scene.gaussians, &cameras)?.images;
            let marked = Scene::read(&path(folder, &mark.id.to_string(), &scene))?.into_gaussians();
            let marked = Views::render(engine, &marked, &cameras)?.images;
            let replaced: Vec<_> = (clean.iter().zip(0_u64..))
                .map(|(view, index)| replace_bits(view, CONTROL_RATE, mark.seed.rotate_left(32) ^ index))
                .collect();
            let clean = DetectorInputs::of_all(&clean);
            for (pairs, suspicious) in [(&mut of_marks, marked), (&mut of_controls, replaced)] {
                if let Some(pairs) = pairs.get_mut(place) {
                    pairs.clean.extend(clean.iter().cloned());
                    pairs.suspicious.extend(DetectorInputs::of_all(&suspicious));
                }
            }
        }
        Ok([of_marks, of_controls])
    }
}

impl WantedDetection {
    fn new(judge: Steganalyzer, control: bool) -> Self {
        Self {
            judge,
            control,
            name: if control {
                format!("{CONTROL}{judge}")
            } else {
                judge.to_string()
            },
        }
    }
}
