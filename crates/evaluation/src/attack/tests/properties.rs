//! What holds for every attack.
use image::RgbImage;
use proptest::prelude::*;

use super::text::step;
use super::{attack, done, varied};
use crate::attack::limits::Grid;
use crate::attack::{Attack, AttackKind, Step, Strength};

fn with(kind: AttackKind, value: Option<f64>) -> Attack {
    let strength = value.map(|value| Strength::new(value, value).unwrap());
    Attack::new(vec![Step::new(kind, strength).unwrap()]).unwrap()
}

/// Each kind with its least and greatest strength and some between.
fn all() -> impl Iterator<Item = Attack> {
    AttackKind::ALL.into_iter().flat_map(|kind| {
        let values = match kind.spec() {
            None => vec![None],
            Some(limits) => {
                let between = [0.001, 0.01, 0.25, 0.5, 0.9].map(|share| {
                    let value = limits.least + share * (limits.most - limits.least);
                    match limits.grid {
                        Grid::Real => value,
                        Grid::Whole => value.round(),
                        Grid::Odd => (value / 2.0).floor() * 2.0 + 1.0,
                    }
                });
                let ends = [limits.least, limits.most, limits.identity.unwrap_or(limits.most)];
                match kind {
                    // Each is two programs to start.
                    AttackKind::Avif if attack("avif:50").missing_program().is_some() => Vec::new(),
                    AttackKind::Avif => vec![Some(30.0)],
                    _ => ends.into_iter().chain(between).map(Some).collect(),
                }
            }
        };
        values.into_iter().map(move |value| with(kind, value))
    })
}

#[test]
fn tiny_pictures_survive_every_attack() {
    for (width, height) in [(1, 1), (2, 3), (1, 9), (17, 1), (2, 2)] {
        for attack in all() {
            for index in 0..3 {
                let result = attack.apply(&varied(width, height), 1, index);
                let (width, height) = result.unwrap().dimensions();
                assert!(width > 0 && height > 0, "{attack}");
            }
        }
    }
}

#[test]
fn identity_strengths_change_nothing() {
    let picture = varied(30, 20);
    assert_eq!(done("none", &picture), picture);
    let mut known = 0;
    for kind in AttackKind::ALL {
        if let Some(identity) = kind.spec().and_then(|limits| limits.identity) {
            assert_eq!(
                with(kind, Some(identity)).apply(&picture, 1, 2).unwrap(),
                picture,
                "{kind:?}"
            );
            known += 1;
        }
    }
    assert_eq!(known, AttackKind::ALL.len() - 7);
}

#[test]
fn nearly_identity_strengths_change_next_to_nothing() {
    // The shortcut for identities is not why they hold.
    let picture = varied(30, 20);
    for text in [
        "noise:0.000001",
        "scale:1.000001",
        "rescale:0.999999",
        "rotate:0.000001",
        "crop:0.999999",
        "crop-random:0.999999",
        "brightness:1.000001",
        "tint:1/1.000001/1",
        "contrast:1.000001",
        "gamma:1.000001",
        "fade:0.000001",
        "curve:0.000001",
        "hue:0.000001",
        "saturation:1.000001",
        "sharpen:1.000001",
        "mask:0.000001",
        "erase:0.000001",
        "fit:30",
        "window:30",
        "rotate:360",
    ] {
        let result = done(text, &picture);
        assert_eq!(result.dimensions(), picture.dimensions(), "{text}");
        let most = result.iter().zip(picture.iter()).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(most <= Some(1), "{text}: {most:?}");
    }
}

#[test]
fn every_other_strength_changes_something() {
    let picture = varied(40, 30);
    let unchanged = |attack: &Attack| attack.apply(&picture, 1, 2).unwrap() == picture;
    for text in [
        "jpeg:100",
        "webp:100",
        "jpeg-turbo:100",
        "mozjpeg:100",
        "noise:0.01",
        "blur:3",
        "median:3",
        "sharpen:1.5",
        "scale:0.9",
        "rescale:0.9",
        "fit:39",
        "rotate:1",
        "quarter-turns:2",
        "flip",
        "crop:0.9",
        "crop-random:0.9",
        "window:39",
        "border:0.1",
        "page:0.9",
        "brightness:0.9",
        "tint:1/0.9/1",
        "contrast:0.9",
        "gamma:0.9",
        "fade:0.1",
        "curve:0.2",
        "hue:0.1",
        "saturation:0.9",
        "grey",
        "bits:7",
        "mask:0.1",
        "erase:0.1",
    ] {
        assert!(!unchanged(&attack(text)), "{text}");
    }
}

#[test]
fn chains_are_their_steps_one_after_the_other() {
    let picture = varied(60, 50);
    let one_by_one = |texts: &[&str]| {
        let apply = |picture: RgbImage, text: &&str| attack(text).apply(&picture, 9, 4).unwrap();
        texts.iter().fold(picture.clone(), apply)
    };
    for texts in [
        ["crop:0.6", "brightness:1.3", "jpeg:50"],
        ["jpeg:50", "brightness:1.3", "crop:0.6"],
        // What is random depends on the kind of a step, not on where it stands.
        ["noise:0.1", "rotate:-30..30", "crop-random:0.4"],
        ["mask:0.1", "scale:0.5..1", "erase:0.1..0.3"],
    ] {
        let chain = attack(&texts.join("+")).apply(&picture, 9, 4).unwrap();
        assert_eq!(chain, one_by_one(&texts), "{texts:?}");
    }
    assert_ne!(
        one_by_one(&["crop:0.6", "jpeg:50"]),
        one_by_one(&["jpeg:50", "crop:0.6"])
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn chains_give_pictures_and_the_same_again(
        steps in prop::collection::vec(step(), 1..=2),
        (width, height) in (1u32..=12, 1u32..=12),
        (seed, index) in any::<(u64, u64)>(),
    ) {
        let attack = Attack::new(steps).unwrap();
        prop_assume!(attack.missing_program().is_none());
        let picture = varied(width, height);
        let result = attack.apply(&picture, seed, index).unwrap();
        prop_assert!(result.width() > 0 && result.height() > 0);
        prop_assert_eq!(&result, &attack.apply(&picture, seed, index).unwrap());
        prop_assert_eq!(&result, &attack.drawn(seed, index).apply(&picture, seed, index).unwrap());
    }
}
