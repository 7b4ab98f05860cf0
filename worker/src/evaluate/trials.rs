//! Reads a mark under all that is done to it, side by side, and makes claims about pictures read together.
use guardsplat_distortion::Vae;
use guardsplat_evaluation::report::record::{Id, Record, claims_id, reading_id};
use guardsplat_evaluation::report::store::Store;
use rayon::prelude::*;

use super::claims::ClaimTrials;
use super::plan::WantedMark;
use super::read::Views;
use super::trial::Trial;
use crate::error::Result;
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Message;
use guardsplat_engine::scene::Gaussians;

/// A mark that is read.
pub(super) struct TrialRun<'a> {
    pub engine: &'a Engine,
    pub message: &'a Message,
    pub mark: &'a Id,
    pub wanted: &'a WantedMark,
    pub claiming: &'a ClaimTrials<'a>,
    /// The learned codec, if its weights were given.
    pub vae: Option<&'a Vae>,
    /// Held-out views.
    pub views: usize,
}

/// What the store does not have of a trial.
#[derive(Clone, Copy)]
pub(super) struct Left<'a> {
    trial: &'a Trial,
    reading: bool,
    claim: bool,
}

impl<'a> TrialRun<'a> {
    /// What is left to do, and can be done here.
    pub fn left(&self, store: &Store) -> Vec<Left<'a>> {
        let (size, views) = (self.claiming.size, self.views as u32);
        let together = self.wanted.together as u32;
        let claimed = together > 0 && together <= views;
        let of = |trial: &'a Trial| {
            let name = trial.to_string();
            let reading = reading_id(self.mark, &name, (size, views, self.wanted.first_view as u32));
            let claim = claims_id(self.mark, &name, true, (size, together, together));
            Left {
                trial,
                reading: !store.has(&reading),
                claim: claimed && !store.has(&claim),
            }
        };
        let possible = |trial: &&Trial| match trial {
            Trial::Vae => self.vae.is_some(),
            _ => trial.missing_program().is_none(),
        };
        let all = self.wanted.trials.iter().filter(possible).map(of);
        all.filter(|left| left.reading || left.claim).collect()
    }

    /// Does what is left; `done` gets the records in the order of the trials, as soon as there are any.
    pub fn carry_out(
        &self,
        left: &[Left<'_>],
        marked: &Gaussians,
        plain: &Views,
        mut done: impl FnMut(Record) -> Result<()>,
    ) -> Result<()> {
        // A GPU has one queue, and waiting for it on the threads of a pool could block them all.
        let on_cpu = self.engine.compute.name == "cpu";
        let beside = if on_cpu { rayon::current_num_threads() } else { 1 };
        for trials in left.chunks(beside) {
            let records: Vec<Vec<Record>> = match trials {
                [one] => vec![self.records(one, marked, plain)?],
                many => many
                    .par_iter()
                    .map(|one| self.records(one, marked, plain))
                    .collect::<Result<_>>()?,
            };
            records.into_iter().flatten().try_for_each(&mut done)?;
        }
        Ok(())
    }

    fn records(&self, left: &Left<'_>, marked: &Gaussians, plain: &Views) -> Result<Vec<Record>> {
        let name = left.trial.to_string();
        let seed = self.claiming.seed;
        let changed = match (left.trial, self.vae) {
            (Trial::Pictures { attack, .. }, _) => plain.attacked(attack, seed)?,
            (Trial::Vae, Some(vae)) => plain.compressed(self.engine, vae)?,
            (Trial::Vae, None) => return Ok(Vec::new()),
            (Trial::Scene(change), _) => Views::render(self.engine, &change.apply(marked, seed)?, &plain.cameras)?,
        };
        let mut records = Vec::new();
        if left.reading {
            let mut reading = changed.record(self.engine, self.message, self.mark, &name, plain)?;
            reading.first_view = self.wanted.first_view as u32;
            records.push(Record::Reading(reading));
        }
        if left.claim {
            records.push(Record::Claims(self.claiming.together(
                &name,
                &changed,
                self.wanted.together,
            )?));
        }
        Ok(records)
    }
}
