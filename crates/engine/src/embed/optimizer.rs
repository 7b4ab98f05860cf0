//! Which optimiser moves the offsets, and with which rates.
use serde::{Deserialize, Serialize};

use super::adam::AdamOptions;
use super::preconditioned_sgd::PreconditionedSgdOptions;
use crate::error::{Error, Result};

/// The optimiser of an embedding.
///
/// In JSON it is what it was before it was one choice: the fields `adam` and `descent` of the settings, of which the
/// second takes the place of the first unless it is null. Hashes of settings, by which stores of evaluations know them, are
/// of that text.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Stored", try_from = "Stored")]
pub enum Optimizer {
    /// Adam.
    Adam(AdamOptions),
    /// Gradient descent with momentum, preconditioned by what a change costs in pictures.
    PreconditionedSgd(PreconditionedSgdOptions),
}

/// The two fields of the settings that stand for an [`Optimizer`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Stored {
    adam: AdamOptions,
    descent: Option<PreconditionedSgdOptions>,
}

impl From<Optimizer> for Stored {
    fn from(optimizer: Optimizer) -> Self {
        match optimizer {
            Optimizer::Adam(adam) => Self { adam, descent: None },
            Optimizer::PreconditionedSgd(sgd) => Self {
                adam: unused_adam(&sgd),
                descent: Some(sgd),
            },
        }
    }
}

impl TryFrom<Stored> for Optimizer {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self> {
        // Also where it is not used: a number that makes no sense is a mistake.
        stored.adam.check()?;
        Ok(match stored.descent {
            Some(sgd) => Self::PreconditionedSgd(sgd),
            None => Self::Adam(stored.adam),
        })
    }
}

/// What JSON has of Adam where it is not used, and what it begins with where it is asked for: the rates of the presets,
/// or 0 for coefficients that are not learned.
fn unused_adam(sgd: &PreconditionedSgdOptions) -> AdamOptions {
    let tuned = AdamOptions::tuned();
    AdamOptions {
        rate_dc: if sgd.dc == 0.0 { 0.0 } else { tuned.rate_dc },
        rate_rest: if sgd.rest == 0.0 { 0.0 } else { tuned.rate_rest },
        ..tuned
    }
}

impl Optimizer {
    /// Checks every rate and decay.
    ///
    /// # Errors
    /// [`Error::BadOption`] naming the setting and its limits.
    pub(super) fn check(&self) -> Result<()> {
        match self {
            Self::Adam(adam) => adam.check(),
            Self::PreconditionedSgd(sgd) => sgd.check(),
        }
    }

    /// The share of the learning rate that is left at the last step.
    pub(super) fn final_rate(&self) -> f32 {
        match self {
            Self::Adam(adam) => adam.final_rate,
            Self::PreconditionedSgd(sgd) => sgd.final_rate,
        }
    }

    /// The same optimiser with its rates of constant (DC) and of all other coefficients multiplied.
    pub(super) fn scaled(self, dc: f32, rest: f32) -> Self {
        match self {
            Self::Adam(adam) => Self::Adam(AdamOptions {
                rate_dc: adam.rate_dc * dc,
                rate_rest: adam.rate_rest * rest,
                ..adam
            }),
            Self::PreconditionedSgd(sgd) => Self::PreconditionedSgd(PreconditionedSgdOptions {
                dc: sgd.dc * dc,
                rest: sgd.rest * rest,
                ..sgd
            }),
        }
    }
}

/// Puts changes of settings into the fields that JSON has: `optimizer`, an object with `adam` or `preconditioned_sgd`, into
/// `adam` and `descent`. Those two are heeded as well, with a warning; so are JSON texts written before there was
/// `optimizer`.
///
/// # Errors
/// What is wrong with `optimizer`.
pub(super) fn accept_names(changes: &mut serde_json::Map<String, serde_json::Value>) -> Result<(), String> {
    for (old, new) in [("adam", "optimizer.adam"), ("descent", "optimizer.preconditioned_sgd")] {
        if changes.contains_key(old) {
            tracing::warn!("the setting {old:?} is called {new:?} now; the old name still works");
        }
    }
    let Some(optimizer) = changes.remove("optimizer") else {
        return Ok(());
    };
    if changes.contains_key("adam") || changes.contains_key("descent") {
        return Err("optimizer: there is \"adam\" or \"descent\" besides, its old names".into());
    }
    let chosen = match optimizer {
        serde_json::Value::Object(fields) if fields.len() == 1 => fields.into_iter().next(),
        _ => None,
    };
    match chosen {
        Some((name, options)) if name == "adam" && options.is_object() => {
            changes.insert("adam".into(), options);
            changes.insert("descent".into(), serde_json::Value::Null);
        }
        Some((name, options)) if name == "preconditioned_sgd" && options.is_object() => {
            changes.insert("descent".into(), options);
        }
        _ => return Err("optimizer: must be an object with the options of either adam or preconditioned_sgd".into()),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::{Preset, TrainableCoefficients};

    #[test]
    fn json_is_as_it_was_with_two_fields() {
        let standard = serde_json::to_string(&Preset::Standard.settings()).unwrap();
        let fields = r#","adam":{"rate_dc":0.014,"rate_rest":0.0012,"final_rate":0.1,"beta1":0.9,"beta2":0.999,"epsilon":1e-15,"sparse":true},"descent":{"length":0.002,"dc":1.0,"rest":0.1,"final_rate":0.05,"momentum":0.2},"balance":"#;
        assert!(standard.contains(fields), "{standard}");
        let paper = serde_json::to_string(&Preset::Paper.settings()).unwrap();
        assert!(
            paper.contains(r#""sparse":false},"descent":null,"balance":null,"#),
            "{paper}"
        );
        let constant = Preset::Standard.settings().learning(TrainableCoefficients::Dc);
        let constant = serde_json::to_string(&constant).unwrap();
        assert!(constant.contains(r#""rate_rest":0.0,"#) && constant.contains(r#""rest":0.0,"#));
    }

    #[test]
    fn the_new_name_and_the_old_ones_say_the_same() {
        let [standard, paper] = [Preset::Standard, Preset::Paper].map(Preset::settings);
        let both = |new: &str, old: &str| {
            let new = standard.overridden(new).unwrap();
            assert_eq!(new, standard.overridden(old).unwrap());
            new.optimizer
        };
        let adam = both(r#"{"optimizer": {"adam": {}}}"#, r#"{"descent": null}"#);
        assert_eq!(adam, Optimizer::Adam(AdamOptions::tuned()));
        let sgd = both(
            r#"{"optimizer": {"preconditioned_sgd": {"length": 0.5}}}"#,
            r#"{"descent": {"length": 0.5}}"#,
        );
        let expected = PreconditionedSgdOptions {
            length: 0.5,
            ..PreconditionedSgdOptions::default()
        };
        assert_eq!(sgd, Optimizer::PreconditionedSgd(expected));
        // From Adam, options that are not given are the usual ones.
        let from_adam = paper.overridden(r#"{"optimizer": {"preconditioned_sgd": {"length": 0.5}}}"#);
        assert_eq!(from_adam.unwrap().optimizer, sgd);
        for wrong in [
            r#"{"optimizer": "adam"}"#,
            r#"{"optimizer": {"sgd": {}}}"#,
            r#"{"optimizer": {"adam": {}}, "descent": null}"#,
            r#"{"optimizer": {"adam": {"rate": 1}}}"#,
            r#"{"adam": {"epsilon": 1}, "descent": {"length": 2}}"#,
        ] {
            assert!(standard.overridden(wrong).is_err(), "{wrong}");
        }
    }
}
