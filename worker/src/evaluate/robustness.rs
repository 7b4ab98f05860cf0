//! The marks of the robustness table, and what they are read under.
use guardsplat_evaluation::attack::Attack;
use guardsplat_evaluation::report::names;
use guardsplat_evaluation::report::targets::Column;

use super::plan::Plan;
use super::trial::Trial;
use crate::error::{Error, Result};
use guardsplat_engine::embed::{Preset, Settings};

/// What `robustness` measures.
#[derive(Clone, Debug, PartialEq)]
pub struct Robustness {
    /// The settings that are called robust.
    pub robust: Settings,
    /// Attacks in place of the table's; none leave those.
    pub attacks: Vec<String>,
}

impl Default for Robustness {
    fn default() -> Self {
        Self {
            robust: Preset::Robust.settings(),
            attacks: Vec::new(),
        }
    }
}

/// Attacks by name, with those of each suite in place of its name.
///
/// # Errors
/// A name that is neither an attack nor a suite.
pub fn attacks(names: &[String]) -> Result<Vec<String>> {
    let mut all: Vec<String> = Vec::new();
    for name in names {
        let these = match Attack::SUITES.contains(&name.as_str()) {
            true => {
                let suite = Attack::suite(name).map_err(Error::Evaluation)?;
                suite.iter().map(ToString::to_string).collect()
            }
            false => vec![name.parse::<Trial>()?.to_string()],
        };
        all.extend(these);
    }
    Ok(all)
}

impl Robustness {
    /// Adds the marks of a column to a plan.
    ///
    /// # Errors
    /// Attacks that cannot be read.
    pub(super) fn add(&self, column: Column, standard: &Settings, plan: &mut Plan) -> Result<()> {
        let settings = match column {
            Column::Standard | Column::Claims => standard,
            Column::Robust => &self.robust,
        };
        let mut trials: Vec<Trial> = Vec::new();
        let mut add = |name: &str| -> Result<()> {
            let trial = name.parse()?;
            if !trials.contains(&trial) {
                trials.push(trial);
            }
            Ok(())
        };
        if self.attacks.is_empty() {
            for attack in column.lines().flat_map(|(line, _)| line.attacks) {
                add(attack)?;
            }
            if column == Column::Robust {
                add(names::VAE)?;
            }
        }
        for attack in &self.attacks {
            add(attack)?;
        }
        let wanted = plan.robustness(column.bits() as usize, column.variant(), *settings, trials);
        wanted.leave_out_views_looked_at();
        if column.claims() {
            wanted.together = column.pictures() as usize;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(attacks: &[&str]) -> Plan {
        let names: Vec<String> = attacks.iter().map(|name| (*name).into()).collect();
        let robustness = Robustness {
            attacks: super::attacks(&names).unwrap(),
            ..Robustness::default()
        };
        let mut plan = Plan::default();
        for column in Column::ALL {
            robustness.add(column, &Preset::Standard.settings(), &mut plan).unwrap();
        }
        plan
    }

    #[test]
    fn each_column_has_marks_of_its_own() {
        let plan = plan(&[]);
        let of = |place: usize| {
            let wanted = &plan.wanted[place];
            (wanted.variant.as_str(), wanted.bits, wanted.together, wanted.first_view)
        };
        assert_eq!(of(0), ("standard", 32, 5, 44));
        assert_eq!(of(1), ("robust", 16, 0, 44));
        assert_eq!(of(2), ("standard", 64, 3, 44));
        assert_eq!(plan.wanted[1].settings, Preset::Robust.settings());
        let names =
            |place: usize| -> Vec<String> { plan.wanted[place].trials.iter().map(ToString::to_string).collect() };
        assert!(names(0).contains(&"occlusion:0.1".into()) && !names(0).contains(&names::VAE.into()));
        assert!(names(1).contains(&names::VAE.into()) && !names(2).contains(&"jpeg:10".into()));
    }

    #[test]
    fn attacks_can_be_chosen_and_suites_are_those_of_the_attacks() {
        for wanted in plan(&["none", "jpeg-turbo:30", "none"]).wanted {
            let names: Vec<String> = wanted.trials.iter().map(ToString::to_string).collect();
            assert_eq!(names, ["none", "jpeg-turbo:30"]);
        }
        let paper = attacks(&["paper".into(), names::VAE.into()]).unwrap();
        assert_eq!(
            paper,
            names::PAPER_ATTACKS
                .map(String::from)
                .into_iter()
                .filter(|n| n != names::VAE)
                .chain([names::VAE.to_string()])
                .collect::<Vec<_>>()
        );
        let error = attacks(&["jpeg:0".into()]).unwrap_err().to_string();
        assert!(error.contains("1 to 100"), "{error}");
    }
}
