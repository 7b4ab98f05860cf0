//! What the experiments of the paper, and ours, need: marks, and what is done to them.
use std::collections::BTreeSet;

use guardsplat_evaluation::report::named::Experiment;
use guardsplat_evaluation::report::names;
use guardsplat_evaluation::report::targets::Column;

use super::robustness::Robustness;
use super::trial::Trial;
use super::variants::Variant;
use crate::error::{Error, Result};
use guardsplat_engine::embed::{Ring, Settings, TrainableCoefficients};

/// Bits of most experiments.
const BITS: usize = 32;
/// Bits of the words that assets are marked with.
const CLAIM_BITS: usize = 64;
/// Bits that other work has a figure for.
const LONGER_BITS: usize = 128;

/// Marks of one length and one variant of the settings, and how they are read.
#[derive(Clone, Debug, PartialEq)]
pub struct WantedMark {
    /// The experiment that asked first.
    pub experiment: Experiment,
    /// Bits of the message.
    pub bits: usize,
    /// What reports call the settings.
    pub variant: String,
    /// The settings, but for their seed.
    pub settings: Settings,
    /// What is done before marks are read.
    pub trials: Vec<Trial>,
    /// Whether seconds are what is asked for.
    pub timed: bool,
    /// Whether claims are made about marks besides.
    pub claims: bool,
    /// Number of the first held-out view that is read.
    pub first_view: usize,
    /// After each trial, pictures that a claim is made about together; 0 for none.
    pub together: usize,
}

impl WantedMark {
    /// Reads no view that an embedding is verified on, or looks at to know when to stop.
    pub(super) fn leave_out_views_looked_at(&mut self) {
        self.first_view = self.first_view.max(self.settings.views_looked_at());
    }
}

/// Everything that some experiments need.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// One of each length and variant.
    pub wanted: Vec<WantedMark>,
    /// Lengths whose standard marks detectors are to judge.
    pub judged: Vec<usize>,
}

/// What `trade` times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trade {
    /// Kind of device, such as "cpu": variants on each are variants of their own.
    pub device: String,
    /// Settings by name.
    pub variants: Vec<Variant>,
}

impl Plan {
    /// Leaves out all variants but these; no names leave all.
    ///
    /// # Errors
    /// A name that there is no variant of.
    pub fn keep_only(&mut self, names: &[String]) -> Result<()> {
        let known = |name: &String| self.wanted.iter().any(|wanted| wanted.variant == *name);
        if let Some(unknown) = names.iter().find(|name| !known(name)) {
            let mut all: Vec<&str> = Vec::new();
            for wanted in &self.wanted {
                if !all.contains(&wanted.variant.as_str()) {
                    all.push(&wanted.variant);
                }
            }
            return Err(Error::bad_option(
                "only",
                format!("{unknown:?} is none of {}", all.join(", ")),
            ));
        }
        self.wanted
            .retain(|wanted| names.is_empty() || names.contains(&wanted.variant));
        Ok(())
    }

    /// Programs of the system that trials need and that are not there, with what to do about it.
    pub fn missing_programs(&self) -> BTreeSet<String> {
        let trials = self.wanted.iter().flat_map(|wanted| &wanted.trials);
        trials.filter_map(Trial::missing_program).collect()
    }

    /// The mark of the robustness table, to be read under these trials.
    pub(super) fn robustness(
        &mut self,
        bits: usize,
        variant: &str,
        settings: Settings,
        trials: Vec<Trial>,
    ) -> &mut WantedMark {
        self.add(Experiment::Robustness, bits, variant, settings, trials)
    }

    fn add(
        &mut self,
        experiment: Experiment,
        bits: usize,
        variant: &str,
        settings: Settings,
        trials: Vec<Trial>,
    ) -> &mut WantedMark {
        let same = |w: &WantedMark| w.bits == bits && w.variant == variant;
        let place = self.wanted.iter().position(same).unwrap_or_else(|| {
            self.wanted.push(WantedMark {
                experiment,
                bits,
                variant: variant.into(),
                settings,
                trials: Vec::new(),
                timed: experiment == Experiment::Trade,
                claims: false,
                first_view: 0,
                together: 0,
            });
            self.wanted.len() - 1
        });
        let wanted = &mut self.wanted[place];
        wanted.claims |= experiment == Experiment::Claims;
        for trial in trials {
            if !wanted.trials.contains(&trial) {
                wanted.trials.push(trial);
            }
        }
        wanted
    }
}

/// What these experiments need with `standard` settings. `bits` restricts lengths, where given; `trade` and `security` are
/// of any length, and of 32 bits without.
///
/// # Errors
/// Attacks of `robustness` that cannot be read.
pub fn plan(
    experiments: &[Experiment],
    standard: &Settings,
    bits: &[usize],
    trade: &Trade,
    robustness: &Robustness,
) -> Result<Plan> {
    let mut plan = Plan::default();
    let free: &[usize] = if bits.is_empty() { &[BITS] } else { bits };
    if experiments.contains(&Experiment::Security) {
        plan.judged = free.to_vec();
    }
    for &kind in experiments {
        let mut add = |bits_of: usize, variant: &str, settings: Settings, trials: &[&str]| -> Result<()> {
            if bits.is_empty() || bits.contains(&bits_of) {
                plan.add(kind, bits_of, variant, settings, parsed(trials)?);
            }
            Ok(())
        };
        let none = [names::NONE];
        match kind {
            Experiment::Capacity => {
                for bits in [16, 32, 48, 64, 72] {
                    add(bits, names::STANDARD, *standard, &none)?;
                }
            }
            Experiment::Longer => add(LONGER_BITS, names::STANDARD, *standard, &none)?,
            Experiment::Robustness => {
                for column in Column::ALL {
                    if bits.is_empty() || bits.contains(&(column.bits() as usize)) {
                        robustness.add(column, standard, &mut plan)?;
                    }
                }
            }
            Experiment::Trained => {
                add(BITS, names::STANDARD, *standard, &none)?;
                add(BITS, names::DC, standard.learning(TrainableCoefficients::Dc), &none)?;
                add(BITS, names::REST, standard.learning(TrainableCoefficients::Rest), &none)?;
            }
            Experiment::Losses => {
                add(BITS, names::STANDARD, *standard, &none)?;
                let mut alone = *standard;
                alone.lambda.reconstruction = 0.0;
                (alone.lambda.offset_dc, alone.lambda.offset_rest) = (0.0, 0.0);
                (alone.balance, alone.early_stop) = (None, None);
                add(BITS, names::MESSAGE_ONLY, alone, &none)?;
                add(BITS, names::FIXED_WEIGHTS, fixed_weights(standard), &none)?;
            }
            Experiment::Pruning => {
                let trials = [names::NONE, names::PRUNE_LOWEST, names::PRUNE_RANDOM];
                add(BITS, names::STANDARD, *standard, &trials)?;
            }
            Experiment::Perturbations => add(BITS, names::STANDARD, *standard, &PERTURBATIONS)?,
            Experiment::Sensitivity => {
                // Where a PSNR is held, weights are changed all along, and what they were at first decides nothing.
                let fixed = fixed_weights(standard);
                add(BITS, names::FIXED_WEIGHTS, fixed, &none)?;
                for weight in [0.25, 0.5, 2.0, 4.0] {
                    let mut likeness = fixed;
                    likeness.lambda.reconstruction *= weight as f32;
                    add(BITS, &format!("{}{weight}", names::LAMBDA_RECON), likeness, &none)?;
                    let mut message = fixed;
                    message.lambda.message *= weight as f32;
                    add(BITS, &format!("{}{weight}", names::LAMBDA_MSG), message, &none)?;
                }
            }
            Experiment::Elevation => {
                add(BITS, names::STANDARD, *standard, &none)?;
                let mut ring = *standard;
                ring.ring = Some(RING);
                add(BITS, names::RING, ring, &none)?;
            }
            Experiment::Formats => {
                let trials = names::formats();
                let trials: Vec<&str> = trials.iter().map(String::as_str).collect();
                add(BITS, names::STANDARD, *standard, &trials)?;
            }
            Experiment::Claims => add(CLAIM_BITS, names::STANDARD, *standard, &none)?,
            // What detectors make of these marks comes after all of them; see `security`.
            Experiment::Security => {
                for bits in free {
                    add(*bits, names::STANDARD, *standard, &none)?;
                }
            }
            Experiment::Trade => {
                let trials = parsed(&[&none[..], &names::SHARED].concat())?;
                for bits in free {
                    for variant in &trade.variants {
                        let name = format!("{}{}:{}", names::TRADE, trade.device, variant.name);
                        plan.add(kind, *bits, &name, variant.settings, trials.clone())
                            .leave_out_views_looked_at();
                    }
                }
            }
        }
    }
    Ok(plan)
}

/// These settings with weights of the loss that stay as they are; all steps are taken, so that runs can be compared.
fn fixed_weights(standard: &Settings) -> Settings {
    Settings {
        balance: None,
        early_stop: None,
        ..*standard
    }
}

/// The circle of views of the variant that is trained on one; the public code's height is that of its data sets.
const RING: Ring = Ring { elevation: 30.0 };
const PERTURBATIONS: [&str; 8] = [
    names::NONE,
    "sh-noise:0.01",
    "sh-noise:0.02",
    "sh-noise:0.05",
    "sh-noise:0.1",
    "occlusion:0.1",
    "occlusion:0.2",
    "occlusion:0.3",
];

fn parsed(texts: &[&str]) -> Result<Vec<Trial>> {
    texts.iter().map(|text| text.parse()).collect()
}

#[cfg(test)]
mod tests;
