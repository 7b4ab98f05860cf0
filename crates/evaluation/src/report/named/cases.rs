//! Which cases each report asks for, whether they were measured or not.
use super::{Experiment, Options};
use crate::report::names::{
    ALL_ATTRIBUTES, DC, FIXED_WEIGHTS, FORMAT, LAMBDA_MSG, LAMBDA_RECON, MESSAGE_ONLY, NONE, OCCLUSION, PRUNE_LOWEST,
    PRUNE_LOWEST_PREFIX, PRUNE_RANDOM, PRUNE_RANDOM_PREFIX, REST, SH_DEGREE, SH_NOISE, STANDARD, formats,
};
use crate::report::paper::{self, ABLATION_BITS, Source};
use crate::report::selection::Selection;
use crate::report::table::Case;
use std::collections::BTreeSet;

/// Bits beyond the paper's for which other work has a figure.
const LONGER_BITS: u32 = 128;

/// A table to be.
pub(super) struct Section {
    pub title: String,
    pub label: &'static str,
    pub quality: bool,
    pub cases: Vec<Case>,
    pub notes: Vec<&'static str>,
}

const RUNS: &str = "Means over runs, a run being one mark of one scene with one seed; in brackets 95 % intervals by \
    Student's t, and Wilson's for whole messages. Views of one mark are not counted as independent.";
const HELD: &str = "The paper's third row has a loss of the offsets' size besides. Here there is none: the weight of likeness \
    is changed all along so that a PSNR is held.";
const PRUNED: &str = "The paper's PSNR is that of pruned marked views against unmarked ones; the column here compares \
    attacked with unattacked marked views.";

pub(super) fn sections(kind: Experiment, selection: &Selection<'_>, options: &Options) -> Vec<Section> {
    let section = |label, quality, cases| Section {
        title: kind.title().into(),
        label,
        quality,
        cases,
        notes: vec![RUNS],
    };
    let measured = |wanted: &dyn Fn(u32) -> bool| -> BTreeSet<u32> {
        let groups = selection.groups().into_iter();
        let bits = groups.filter(|(_, variant)| *variant == STANDARD).map(|(bits, _)| bits);
        bits.filter(|bits| wanted(*bits)).collect()
    };
    match kind {
        Experiment::Capacity => {
            let longest = paper::BITS.into_iter().max().unwrap_or(0);
            let mut bits = measured(&|bits| bits <= longest);
            bits.extend(paper::BITS);
            vec![section("bits", true, by_bits(bits, Some(Source::Capacity)))]
        }
        Experiment::Longer => {
            let longest = paper::BITS.into_iter().max().unwrap_or(0);
            let mut bits = measured(&|bits| bits > longest);
            bits.insert(LONGER_BITS);
            vec![section("bits", true, by_bits(bits, None))]
        }
        Experiment::Trained => {
            let variants = [
                ("all attributes", ALL_ATTRIBUTES),
                ("DC only", DC),
                ("rest only", REST),
                ("DC and rest (standard)", STANDARD),
            ];
            let cases = by_variant(ABLATION_BITS, variants, Some(Source::Trained));
            vec![section("learned", true, cases)]
        }
        Experiment::Losses => {
            let variants = [
                ("message", MESSAGE_ONLY),
                ("message and likeness, weights fixed", FIXED_WEIGHTS),
                ("message and likeness, PSNR held (standard)", STANDARD),
            ];
            let mut losses = section(
                "losses",
                true,
                by_variant(ABLATION_BITS, variants, Some(Source::Losses)),
            );
            losses.notes.push(HELD);
            vec![losses]
        }
        Experiment::Pruning => {
            let mut attacks = vec![NONE, PRUNE_LOWEST, PRUNE_RANDOM];
            for prefix in [PRUNE_LOWEST_PREFIX, PRUNE_RANDOM_PREFIX] {
                attacks.extend(family(selection, ABLATION_BITS, prefix, &attacks));
            }
            let mut pruning = section(
                "removed",
                false,
                by_attack(ABLATION_BITS, attacks, Some(Source::Pruning)),
            );
            pruning.notes.push(PRUNED);
            vec![pruning]
        }
        Experiment::Perturbations => {
            let mut attacks = vec![NONE];
            for prefix in [SH_NOISE, OCCLUSION] {
                let known = family(selection, options.bits, prefix, &[]);
                // Without any, the family itself is what was not measured.
                let asked = if known.is_empty() { vec![prefix] } else { known };
                attacks.extend(asked);
            }
            vec![section("perturbed", false, by_attack(options.bits, attacks, None))]
        }
        Experiment::Formats => {
            let names = formats();
            let expected: Vec<&str> = names.iter().map(String::as_str).collect();
            let more = [FORMAT, SH_DEGREE].map(|prefix| family(selection, options.bits, prefix, &expected));
            let attacks = expected.iter().copied().chain(more.into_iter().flatten()).collect();
            vec![section("format", false, by_attack(options.bits, attacks, None))]
        }
        Experiment::Sensitivity => {
            let weights = [(LAMBDA_RECON, "likeness"), (LAMBDA_MSG, "message")];
            let of_weight = |(prefix, name): (&str, &str)| {
                let mut section = section("weight", true, by_weight(selection, options.bits, prefix));
                section.title = format!("Weight of the loss of the {name}, no PSNR held");
                section
            };
            weights.into_iter().map(of_weight).collect()
        }
        Experiment::Robustness
        | Experiment::Elevation
        | Experiment::Security
        | Experiment::Claims
        | Experiment::Trade => Vec::new(),
    }
}

fn case(label: String, bits: u32, variant: &str, attack: &str, source: Option<Source>) -> Case {
    Case {
        label,
        bits,
        variant: variant.into(),
        attack: attack.into(),
        paper: source.and_then(|source| paper::figure(source, bits, variant, attack)),
    }
}

fn by_bits(bits: BTreeSet<u32>, source: Option<Source>) -> Vec<Case> {
    let case = |bits: u32| case(bits.to_string(), bits, STANDARD, NONE, source);
    bits.into_iter().map(case).collect()
}

fn by_attack(bits: u32, attacks: Vec<&str>, source: Option<Source>) -> Vec<Case> {
    let case = |attack: &str| case(attack.into(), bits, STANDARD, attack, source);
    attacks.into_iter().map(case).collect()
}

fn by_variant<const N: usize>(bits: u32, variants: [(&str, &str); N], source: Option<Source>) -> Vec<Case> {
    let case = |(label, variant): (&str, &str)| case(label.into(), bits, variant, NONE, source);
    variants.into_iter().map(case).collect()
}

/// Variants whose name is a prefix and a weight, by weight, and fixed weights as they are to compare with.
fn by_weight(selection: &Selection<'_>, bits: u32, prefix: &str) -> Vec<Case> {
    let weight = |variant: &str| variant.strip_prefix(prefix).and_then(|text| text.parse::<f64>().ok());
    let groups = selection.groups().into_iter().filter(|(of, _)| *of == bits);
    let known = groups.filter(|(_, variant)| variant.starts_with(prefix));
    let mut variants: Vec<&str> = known.map(|(_, variant)| variant).collect();
    variants.sort_by(|a, b| {
        let order = |variant| weight(variant).unwrap_or(f64::INFINITY);
        order(a).total_cmp(&order(b)).then(a.cmp(b))
    });
    if variants.is_empty() {
        variants.push(prefix);
    }
    let fixed = case("as they are".into(), bits, FIXED_WEIGHTS, NONE, None);
    let others = variants
        .into_iter()
        .map(|variant| case(variant.into(), bits, variant, NONE, None));
    std::iter::once(fixed).chain(others).collect()
}

/// Attacks that marks of so many bits were read under.
fn attacks<'a>(selection: &Selection<'a>, bits: u32) -> impl Iterator<Item = &'a str> {
    let has_runs = move |attack: &&str| !selection.runs(bits, STANDARD, attack).is_empty();
    selection.attacks().into_iter().filter(has_runs)
}

/// Attacks of a family that are not among those known, by name.
fn family<'a>(selection: &Selection<'a>, bits: u32, prefix: &str, known: &[&str]) -> Vec<&'a str> {
    let all = attacks(selection, bits);
    all.filter(|attack| attack.starts_with(prefix) && !known.contains(attack))
        .collect()
}
