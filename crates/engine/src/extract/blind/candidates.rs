//! All candidates for what was done to one picture, over its parts and changes of tones, as the search goes on.
use super::parts::Part;
use super::prior::Prior;
use super::score::{self, Spread};
use super::search::{self, Read, Reader};
use super::sweep;
use super::{Candidate, joint, reader, undone_on_white};
use crate::error::Result;
use crate::extract::Engine;
use crate::extract::photometric::{ColourHistogram, Fineness, ToneChange, ground, white_balance};
use crate::picture::Picture;

/// Logits of each picture.
type Rows = Vec<Vec<f32>>;

/// Histograms on which many changes are looked at; the best of them are looked at, and refined, on [finer ones](Fineness::FINE).
const ROUGH: Fineness = Fineness {
    cells: 1.0 / 48.0,
    most: 2000,
};

/// Changes that looked best on a rough histogram, and are looked at on a fine one.
const CHECKED: usize = 16;

/// A search over the parts of a picture.
pub(super) struct Search<'a> {
    engine: &'a Engine,
    /// The whole, at the side that the extractor takes in: contrast is changed about its mean.
    whole: &'a Picture,
    parts: &'a [(Part, Picture)],
    /// What is known of each part before anything is read.
    priors: Vec<Prior<'a>>,
    /// Histograms of the parts that were looked at.
    histograms: Vec<Option<ColourHistogram>>,
    /// Logits of the parts before anything is undone.
    as_they_are: Rows,
    found: Vec<Candidate>,
    /// Candidates from which a refinement has begun.
    refined: Vec<Candidate>,
    /// How scores of wrong candidates are spread.
    spread: Option<Spread>,
}

impl<'a> Search<'a> {
    /// Begins with all parts as they are.
    ///
    /// # Errors
    /// A failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn of_parts(engine: &'a Engine, whole: &'a Picture, parts: &'a [(Part, Picture)]) -> Result<Self> {
        let pictures: Vec<Picture> = parts.iter().map(|(_, small)| small.clone()).collect();
        let as_they_are = engine.read_logits(&pictures)?;
        let found = parts.iter().zip(&as_they_are).filter_map(|((part, _), logits)| {
            let score = score::of_logits(logits);
            score.is_finite().then(|| Candidate {
                part: *part,
                white: false,
                change: ToneChange::default(),
                score: score - part.cost(),
                logits: logits.clone(),
            })
        });
        let found = found.collect();
        Ok(Self {
            engine,
            whole,
            parts,
            priors: parts.iter().map(|(_, small)| Prior::of(small, whole)).collect(),
            histograms: parts.iter().map(|_| None).collect(),
            as_they_are,
            found,
            refined: Vec::new(),
            spread: None,
        })
    }

    /// Tries changes of the tones of a part: many on a rough histogram of it, if the extractor reads such, and the best of them
    /// on a fine one.
    ///
    /// # Errors
    /// A failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn sweep(&mut self, place: usize, hints: &[ToneChange]) -> Result<()> {
        let ((part, small), whole) = (&self.parts[place], self.whole);
        let prior = self.priors[place];
        let ground = ground::colour(small);
        let anchor = ground.map(|ground| move |change: ToneChange| change.with_white(ground, whole));
        let anchor = anchor
            .as_ref()
            .map(|anchor| anchor as &dyn Fn(ToneChange) -> ToneChange);
        let mut changes = sweep::lines(anchor);
        let sides = self.engine.extractor.colour_scales();
        if !sides.is_empty() {
            let histogram = ColourHistogram::of(small, sides, ROUGH);
            changes.extend(sweep::tinted());
            if let Some((ground, anchor)) = ground.zip(anchor) {
                changes.extend(sweep::overlays(ground));
                let cut = white_balance::cut(ground);
                changes.extend(cut.map_or_else(Vec::new, |cut| sweep::filters(anchor, cut)));
            }
            let mut rough = search::tried(
                &mut *reader::of_histogram(self.engine, &histogram, whole),
                &prior,
                &changes,
            )?;
            self.spread = Spread::of(rough.iter().map(|read| read.score));
            rough.sort_by(|a, b| b.score.total_cmp(&a.score));
            changes = vec![ToneChange::default()];
            changes.extend(rough.iter().take(CHECKED).map(|read| read.change));
        }
        changes.extend_from_slice(hints);
        let found = search::tried(&mut *self.reader(place), &prior, &changes)?;
        if sides.is_empty() || self.spread.is_none() {
            self.spread = Spread::of(found.iter().map(|read| read.score));
        }
        self.add(*part, found);
        Ok(())
    }

    /// Refines the best candidates that lie apart, so many of them, until one is clear.
    ///
    /// # Errors
    /// A failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn refine(&mut self, starts: usize) -> Result<()> {
        for _ in 0..starts {
            let new = |candidate: &&Candidate| self.refined.iter().all(|start| candidate.lies_apart_from(start));
            let best = self.found.iter().filter(new).max_by(|a, b| a.score.total_cmp(&b.score));
            let Some(best) = best.cloned() else { break };
            let Some(place) = self.parts.iter().position(|(part, _)| *part == best.part) else {
                break;
            };
            let (part, prior) = (self.parts[place].0, self.priors[place]);
            let start = Read {
                change: best.change,
                logits: best.logits.clone(),
                score: best.score + part.cost(),
            };
            self.refined.push(best);
            let found = search::refined(&mut *self.reader(place), &prior, start)?;
            self.add(part, found);
            if self.is_clear() {
                break;
            }
        }
        Ok(())
    }

    /// Whether the best candidate stands out.
    pub fn is_clear(&self) -> bool {
        self.spread.is_some_and(|spread| spread.is_clear(self.best_score()))
    }

    /// Whether it does so without a doubt.
    pub fn is_certain(&self) -> bool {
        self.spread.is_some_and(|spread| spread.is_certain(self.best_score()))
    }

    fn best_score(&self) -> f64 {
        let scores = self.found.iter().map(|candidate| candidate.score);
        scores.fold(f64::NEG_INFINITY, f64::max)
    }

    /// The place of the part whose tones are worth a search besides the first's: the best as it is, if it is better than
    /// that.
    pub fn promising(&self) -> Option<usize> {
        let as_it_is = |part: &Part| {
            let mut found = self
                .found
                .iter()
                .filter(|c| c.part == *part && c.change == ToneChange::default());
            found.next().map_or(f64::NEG_INFINITY, |candidate| candidate.score)
        };
        let scores: Vec<f64> = self.parts.iter().map(|(part, _)| as_it_is(part)).collect();
        let best = (1..scores.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
        (scores[best] > scores[0]).then_some(best)
    }

    /// The best candidates that lie apart, best first, and last what was read first: the whole as it is, or what is within
    /// its borders.
    pub fn best(mut self) -> Vec<Candidate> {
        let as_it_is = self.found.first().cloned();
        self.found.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut best: Vec<Candidate> = Vec::with_capacity(joint::MOST);
        for candidate in self.found {
            if best.len() + 1 >= joint::MOST {
                break;
            }
            if best.iter().all(|other| candidate.lies_apart_from(other)) {
                best.push(candidate);
            }
        }
        let missing = as_it_is.filter(|as_it_is| best.iter().all(|other| as_it_is.lies_apart_from(other)));
        best.extend(missing);
        best
    }

    /// Logits of the windows as they are, in their order.
    pub fn windows(&self) -> Rows {
        let parts = self.parts.iter().zip(&self.as_they_are);
        let windows = parts.filter(|((part, _), _)| matches!(part, Part::Window(_)));
        windows.map(|(_, logits)| logits.clone()).collect()
    }

    fn add(&mut self, part: Part, found: Vec<Read>) {
        self.found.extend(found.into_iter().map(|read| Candidate {
            part,
            white: true,
            change: read.change,
            score: read.score - part.cost(),
            logits: read.logits,
        }));
    }

    /// Reads a part with changes undone, and its ground made white where it shows one: its histogram, where the extractor reads
    /// such.
    fn reader(&mut self, place: usize) -> Box<Reader<'_>> {
        let (engine, whole, small) = (self.engine, self.whole, &self.parts[place].1);
        let sides = engine.extractor.colour_scales();
        if sides.is_empty() {
            let undone = move |change: &ToneChange| undone_on_white(change, small, whole);
            return reader::of_pictures(engine, undone);
        }
        let histogram = self.histograms[place].get_or_insert_with(|| ColourHistogram::of(small, sides, Fineness::FINE));
        reader::of_histogram(engine, histogram, whole)
    }
}
