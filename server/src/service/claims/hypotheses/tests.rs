//! Readings as they are checked, named and counted.
use super::*;
use crate::error::Error;
use guardsplat_proto::v1::PicturePart;

fn reading(quarter_turns: u32, mirrored: bool, trimmed: bool) -> FramedReading {
    FramedReading {
        quarter_turns,
        mirrored,
        trimmed,
        views: 1,
        logits: vec![1.0; 64],
        undone: None,
        part: None,
        leading_picture: 0,
    }
}

fn part(left: u32, top: u32, side: u32) -> FramedReading {
    FramedReading {
        part: Some(PicturePart {
            left_twelfths: left,
            top_twelfths: top,
            side_twelfths: side,
        }),
        ..reading(0, false, false)
    }
}

fn brightened(factor: f32) -> FramedReading {
    FramedReading {
        undone: Some(Undone {
            kind: Kind::Brightness.into(),
            factor,
            ..Undone::default()
        }),
        ..reading(0, false, false)
    }
}

fn all() -> Vec<FramedReading> {
    let each = (0..16).map(|i| reading(i % 4, i & 4 > 0, i & 8 > 0));
    each.collect()
}

#[test]
fn every_framing_has_a_name_and_counts_once() {
    let names: HashSet<_> = checked(&all(), 64).unwrap().into_iter().map(|f| f.name).collect();
    assert_eq!(names.len(), 16);
    assert!(names.contains("as given") && names.contains("turned by 270 degrees, mirrored, without borders"));
    let counts: Vec<_> = kinds(&all(), &checked(&all(), 64).unwrap())
        .iter()
        .map(|framing| framing.variants)
        .collect();
    assert_eq!(counts, [1, 3, 4, 8]);
}

#[test]
fn tones_are_framings_of_their_own() {
    let readings = [reading(0, false, false), brightened(0.81), brightened(1.5)];
    let names: Vec<_> = checked(&readings, 64).unwrap().into_iter().map(|f| f.name).collect();
    assert_eq!(names[1], "brightness x 0.81 undone");
    assert_eq!(names.iter().collect::<HashSet<_>>().len(), 3);
    let counts: Vec<_> = kinds(&readings, &checked(&readings, 64).unwrap())
        .iter()
        .map(|framing| framing.variants)
        .collect();
    assert_eq!(counts, [1, 2]);
    assert!(checked(&[brightened(0.81), brightened(0.81)], 64).is_err());
    assert!(checked(&[brightened(0.0)], 64).is_err() && checked(&[brightened(f32::NAN)], 64).is_err());
}

#[test]
fn white_balances_are_told_by_channel() {
    let balanced = |red: f32| FramedReading {
        undone: Some(Undone {
            kind: Kind::WhiteBalance.into(),
            factor: 1.0,
            red,
            green: 1.025,
            blue: 1.05,
        }),
        ..reading(0, false, false)
    };
    let readings = [reading(0, false, false), balanced(1.0), balanced(1.05)];
    let names: Vec<_> = checked(&readings, 64).unwrap().into_iter().map(|f| f.name).collect();
    let told = |beyond: &str, tints: &str| {
        format!("white balance undone: red, green, blue x {beyond} beyond a white ground, x {tints} without one")
    };
    assert_eq!(names[1], told("1.00, 1.02, 1.05", "0.96, 1.00, 1.04"));
    assert_eq!(names[2], told("1.05, 1.02, 1.05", "1.04, 1.00, 1.04"));
    assert!(checked(&[balanced(1.0), balanced(1.0)], 64).is_err() && checked(&[balanced(0.0)], 64).is_err());
    let mut brightness = brightened(0.9);
    brightness.undone.as_mut().unwrap().red = 1.0;
    assert!(checked(&[brightness], 64).is_err());
}

#[test]
fn an_estimate_is_one_framing_whatever_it_took() {
    let mut estimated = brightened(1.0);
    estimated.undone = Some(Undone {
        kind: Kind::Estimated.into(),
        factor: 1.0,
        ..Undone::default()
    });
    let readings = [reading(0, false, false), estimated];
    let names: Vec<_> = checked(&readings, 64).unwrap().into_iter().map(|f| f.name).collect();
    assert_eq!(names[1], "tones and part estimated from each picture");
    let counts: Vec<_> = kinds(&readings, &checked(&readings, 64).unwrap())
        .iter()
        .map(|framing| framing.variants)
        .collect();
    assert_eq!(counts, [1, 1]);
}

#[test]
fn the_next_best_estimates_share_what_one_kind_has() {
    let estimate = |place: f32| FramedReading {
        undone: Some(Undone {
            kind: Kind::Estimated.into(),
            factor: place,
            ..Undone::default()
        }),
        ..reading(0, false, false)
    };
    let mut readings = vec![reading(0, false, false)];
    readings.extend([1.0, 2.0, 3.0, 4.0].map(estimate));
    readings.extend([brightened(0.81), brightened(1.5)]);
    let read = checked(&readings, 64).unwrap();
    assert_eq!(read[3].name, "tones and part by estimate 3 of this picture");
    let groups: Vec<_> = kinds(&readings, &read)
        .iter()
        .map(|group| (group.kind, group.variants, group.tries))
        .collect();
    use evidence::HypothesisKind::{AsGiven, Estimated, Tone};
    let expected = [(AsGiven, 1, 2), (Estimated, 1, 4), (Estimated, 3, 24), (Tone, 2, 16)];
    assert_eq!(groups, expected.map(|(kind, count, tries)| (kind, count, Some(tries))));
    assert!(checked(&[estimate(2.0), estimate(2.0)], 64).is_err());
}

#[test]
fn what_differs_from_the_original_has_half_of_what_is_left() {
    let undone = |kind: Kind| FramedReading {
        undone: Some(Undone {
            kind: kind.into(),
            factor: 1.0,
            ..Undone::default()
        }),
        ..reading(0, false, false)
    };
    let kinds_told = [
        Kind::Estimated,
        Kind::Original,
        Kind::OriginalFitted,
        Kind::OriginalMatched,
    ];
    let readings: Vec<_> = std::iter::once(reading(0, false, false))
        .chain(kinds_told.map(undone))
        .chain([brightened(0.81)])
        .collect();
    let read = checked(&readings, 64).unwrap();
    assert_eq!(read[2].name, "compared with the original, tones as given");
    assert_eq!(read[3].name, "compared with the original, tones fitted to it");
    assert_eq!(read[4].name, "compared with the original by a matched filter");
    let groups = kinds(&readings, &read);
    use evidence::HypothesisKind::{AsGiven, Estimated, Registered, Tone};
    let told: Vec<_> = groups.iter().map(|g| (g.kind, g.variants, g.tries.unwrap())).collect();
    assert_eq!(
        told,
        [(AsGiven, 1, 2), (Registered, 3, 12), (Estimated, 1, 8), (Tone, 1, 8)]
    );
}

#[test]
fn what_one_picture_leads_is_a_framing_of_its_own() {
    let led = |picture: u32| FramedReading {
        leading_picture: picture,
        views: 2,
        ..reading(0, false, false)
    };
    let readings = [reading(0, false, false), led(1), led(2)];
    let read = checked(&readings, 64).unwrap();
    assert_eq!(read[2].name, "as given: picture 2, the others as they agree with it");
    let groups: Vec<_> = kinds(&readings, &read).iter().map(|g| (g.kind, g.variants)).collect();
    use evidence::HypothesisKind::{AsGiven, Led};
    assert_eq!(groups, [(AsGiven, 1), (Led, 2)]);
    assert!(checked(&[led(1), led(1)], 64).is_err() && checked(&[led(3)], 64).is_err());
}

#[test]
fn parts_are_framings_of_their_own_and_lie_within_the_picture() {
    let readings = [reading(0, false, false), part(3, 0, 6), part(4, 0, 6)];
    let names: Vec<_> = checked(&readings, 64).unwrap().into_iter().map(|f| f.name).collect();
    assert_eq!(names[1], "50 % of its sides from 25 % right and 0 % down");
    let counts: Vec<_> = kinds(&readings, &checked(&readings, 64).unwrap())
        .iter()
        .map(|framing| framing.variants)
        .collect();
    assert_eq!(counts, [1, 2]);
    assert!(checked(&[part(3, 0, 6), part(3, 0, 6)], 64).is_err());
    for outside in [
        part(7, 0, 6),
        part(0, 7, 6),
        part(0, 0, 0),
        part(13, 0, 1),
        part(0, u32::MAX, 1),
    ] {
        assert!(checked(&[outside], 64).is_err());
    }
}

#[test]
fn what_makes_no_sense_is_told_by_field() {
    let mut wrong = reading(4, false, false);
    wrong.views = 0;
    wrong.logits.pop();
    let readings = [reading(0, false, false), wrong, reading(0, false, false)];
    let Err(Error::Invalid(violations)) = checked(&readings, 64) else {
        panic!("was taken")
    };
    let fields: Vec<_> = violations.iter().map(|v| v.field.as_str()).collect();
    let second = ["quarter_turns", "views", "logits"].map(|name| format!("readings[1].{name}"));
    assert_eq!(fields[..3], second);
    assert_eq!(fields[3..], ["readings[2]"]);
    assert!(checked(&vec![all(); 65].concat(), 64).is_err());
}
