//! Variants of the settings that are timed: the presets, one change at a time of what costs time, and a user's own.
use serde::Deserialize;

use crate::error::{Error, Result};
use guardsplat_engine::embed::{Preset, Settings};

/// What settings are called that are no preset.
const BASE: &str = "base";
/// Longest name of a variant, so that tables and plots can show it.
const LONGEST: usize = 40;

/// Single changes, as JSON in place of fields of the settings: steps, views a step and how many of them are new, size of
/// pictures, precision of what views are kept in, terms of likeness, optimiser, and how the rate falls over the steps.
const CHANGES: [(&str, &str); 19] = [
    ("steps-50", r#"{"steps": 50}"#),
    ("steps-100", r#"{"steps": 100}"#),
    ("steps-200", r#"{"steps": 200}"#),
    ("steps-800", r#"{"steps": 800}"#),
    ("full-length", r#"{"early_stop": null}"#),
    ("views-2", r#"{"views_per_step": 2, "fresh_per_step": 1}"#),
    ("views-4", r#"{"views_per_step": 4, "fresh_per_step": 2}"#),
    ("views-16", r#"{"views_per_step": 16, "fresh_per_step": 8}"#),
    ("fresh-1", r#"{"fresh_per_step": 1}"#),
    ("size-96", r#"{"size": 96}"#),
    ("size-128", r#"{"size": 128}"#),
    ("size-224", r#"{"size": 224}"#),
    ("half-weights", r#"{"half_weights": true}"#),
    ("without-ssim", r#"{"lambda": {"ssim": 0}}"#),
    ("lpips", r#"{"lambda": {"lpips": 2}}"#),
    (
        "adam",
        r#"{"optimizer": {"adam": {}}, "lambda": {"l1": 0.8, "l2": 0, "ssim": 0.2}}"#,
    ),
    (
        "rate-flat",
        r#"{"optimizer": {"preconditioned_sgd": {"final_rate": 1}}}"#,
    ),
    (
        "rate-to-0",
        r#"{"optimizer": {"preconditioned_sgd": {"final_rate": 0}}}"#,
    ),
    (
        "distorted",
        r#"{"robust_to": ["crop", "scaling", "rotation", "brightness", "contrast", "jpeg", "noise", "blur", "mask",
            "8bit", "combined", "sh-noise", "sh-truncation", "spz", "sog", "pruning"]}"#,
    ),
];

/// Settings with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// What tables and plots call it.
    pub name: String,
    /// The settings.
    pub settings: Settings,
}

/// A variant as a user's file has it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CustomVariant {
    name: String,
    /// What is changed; the settings that the run has by default.
    preset: Option<String>,
    #[serde(default)]
    settings: serde_json::Map<String, serde_json::Value>,
}

/// The variants to be timed: `base`, the presets, single changes of `base`, and those of `own`, the text of a file with a
/// JSON array such as
///
/// ```json
/// [{"name": "quick", "preset": "draft", "settings": {"steps": 60}}]
/// ```
///
/// `only` chooses some by their names, in the order of the list; empty, it takes all. Changes that change nothing are
/// left out.
///
/// # Errors
/// A file that is no such array, names that are empty, too long, or there twice, settings that are refused, and names in
/// `only` that there are none of.
pub fn variants(base: &Settings, own: Option<&str>, only: &[String]) -> Result<Vec<Variant>> {
    let presets = Preset::ALL.map(|preset| (preset.name(), preset.settings()));
    let mut all: Vec<Candidate> = Vec::new();
    if !presets.iter().any(|(_, settings)| settings == base) {
        all.push(Candidate::settled(BASE, *base));
    }
    all.extend(presets.map(|(name, settings)| Candidate::settled(name, settings)));
    for (name, change) in CHANGES {
        all.push(Candidate::changed(name, *base, change.into()));
    }
    for own in own.map(parse).transpose()?.unwrap_or_default() {
        let from = own.preset.as_deref().map(str::parse::<Preset>).transpose()?;
        let from = from.map_or(*base, Preset::settings);
        all.push(Candidate::changed(
            &own.name,
            from,
            serde_json::Value::Object(own.settings).to_string(),
        ));
    }
    for (place, one) in all.iter().enumerate() {
        check_name(&one.name)?;
        if all.iter().skip(place + 1).any(|other| other.name == one.name) {
            return Err(bad(format!("there are two that are called {:?}", one.name)));
        }
    }
    if let Some(unknown) = only.iter().find(|name| !all.iter().any(|one| one.name == **name)) {
        let names: Vec<&str> = all.iter().map(|one| one.name.as_str()).collect();
        return Err(bad(format!("{unknown:?} is none of {}", names.join(", "))));
    }
    let chosen = all
        .into_iter()
        .filter(|one| only.is_empty() || only.contains(&one.name));
    let made = chosen.map(Candidate::make).collect::<Result<Vec<_>>>()?;
    let changes_nothing = |one: &Variant| one.settings == *base && CHANGES.iter().any(|(name, _)| *name == one.name);
    Ok(made.into_iter().filter(|one| !changes_nothing(one)).collect())
}

/// A variant whose settings are not checked before it is chosen.
struct Candidate {
    name: String,
    from: Settings,
    change: Option<String>,
}

impl Candidate {
    fn settled(name: &str, settings: Settings) -> Self {
        Self {
            name: name.into(),
            from: settings,
            change: None,
        }
    }

    fn changed(name: &str, from: Settings, change: String) -> Self {
        Self {
            name: name.into(),
            from,
            change: Some(change),
        }
    }

    fn make(self) -> Result<Variant> {
        let settings = match &self.change {
            None => self.from,
            Some(change) => self
                .from
                .overridden(change)
                .map_err(|e| bad(format!("{}: {e}", self.name)))?,
        };
        Ok(Variant {
            name: self.name,
            settings,
        })
    }
}

fn parse(text: &str) -> Result<Vec<CustomVariant>> {
    serde_json::from_str(text).map_err(|e| bad(e.to_string()))
}

fn check_name(name: &str) -> Result<()> {
    let length = name.chars().count();
    if name.trim() != name || name.is_empty() || length > LONGEST || name.chars().any(char::is_control) {
        return Err(bad(format!(
            "{name:?} is no name: 1 to {LONGEST} characters, without spaces around"
        )));
    }
    Ok(())
}

fn bad(reason: String) -> Error {
    Error::bad_option("variants", reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use guardsplat_distortion::RobustTo;

    fn names(variants: &[Variant]) -> Vec<&str> {
        variants.iter().map(|one| one.name.as_str()).collect()
    }

    fn only(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).into()).collect()
    }

    #[test]
    fn presets_and_changes_differ_from_each_other() {
        let base = Preset::Standard.settings();
        let all = variants(&base, None, &[]).unwrap();
        assert_eq!(
            names(&all)[..6],
            ["draft", "standard", "robust", "thorough", "paper", "steps-50"]
        );
        for (place, one) in all.iter().enumerate() {
            one.settings.check().unwrap();
            assert!(
                !all[place + 1..].iter().any(|other| other.settings == one.settings),
                "{}",
                one.name
            );
        }
        assert_eq!(all.len(), Preset::ALL.len() + CHANGES.len());
        let distorted = all.iter().find(|one| one.name == "distorted").unwrap();
        assert_eq!(distorted.settings.robust_to, RobustTo::all());
    }

    #[test]
    fn other_settings_are_the_base_of_changes() {
        let base = Preset::Draft
            .settings()
            .overridden(r#"{"steps": 100, "half_weights": true}"#)
            .unwrap();
        let all = variants(&base, None, &[]).unwrap();
        assert_eq!(names(&all)[..2], ["base", "draft"]);
        // They change nothing here.
        assert!(!names(&all).contains(&"steps-100") && !names(&all).contains(&"half-weights"));
        let small = all.iter().find(|one| one.name == "size-96").unwrap();
        assert_eq!((small.settings.size, small.settings.steps), (96, 100));
    }

    #[test]
    fn own_variants_and_choices() {
        let base = Preset::Standard.settings();
        let own = r#"[{"name": "quick", "preset": "draft", "settings": {"steps": 60}}, {"name": "same"}]"#;
        let chosen = variants(&base, Some(own), &only(&["same", "draft", "quick"])).unwrap();
        assert_eq!(names(&chosen), ["draft", "quick", "same"]);
        assert_eq!(chosen[1].settings.balance, Preset::Draft.settings().balance);
        assert_eq!((chosen[1].settings.steps, chosen[2].settings), (60, base));
        // What is not chosen may be wrong.
        let wrong = r#"[{"name": "wrong", "settings": {"steps": 0}}]"#;
        assert_eq!(variants(&base, Some(wrong), &only(&["draft"])).unwrap().len(), 1);
        let reason = |own: &str, names: &[&str]| variants(&base, Some(own), &only(names)).unwrap_err().to_string();
        assert!(reason(wrong, &[]).contains("wrong: steps"));
        assert!(reason("{}", &[]).contains("variants"));
        assert!(reason("[]", &["magic"]).contains("\"magic\" is none of draft, standard"));
        assert!(reason(r#"[{"name": "draft"}]"#, &[]).contains("two that are called \"draft\""));
        assert!(reason(r#"[{"name": " "}]"#, &[]).contains("no name"));
        assert!(reason(r#"[{"name": "a", "preset": "fast"}]"#, &[]).contains("fast"));
        assert!(reason(r#"[{"name": "a", "setings": {}}]"#, &[]).contains("setings"));
    }
}
