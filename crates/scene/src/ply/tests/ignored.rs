//! Rows with values that are not legal, left out where that was asked for.
use super::*;
use crate::BadRows;
use crate::ignored::tests::without;
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

fn ignoring(bytes: &[u8]) -> Result<Scene> {
    Scene::parse_with(Path::new("test.ply"), bytes, BadRows::Ignore)
}

fn reason(bytes: &[u8]) -> String {
    ignoring(bytes).unwrap_err().to_string()
}

/// What no property may be, or only some.
const POISONS: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

fn legal(name: &str, value: f64) -> bool {
    let infinite = name == "opacity" || name.starts_with("scale") && value < 0.0;
    infinite && !value.is_nan()
}

proptest! {
    #[test]
    fn bad_rows_are_counted_and_never_change(
        encoding in prop::sample::select(ENCODINGS.to_vec()),
        degree in 0..=3usize,
        double in any::<bool>(),
        rows in 1..9usize,
        poisons in prop::collection::vec((0..9usize, any::<prop::sample::Index>(), 0..3usize), 0..6),
        changes in prop::collection::vec((-40..40i32, 0..9usize), 0..9),
    ) {
        let file = || {
            let mut file = File::new(encoding, degree, rows).add("nx", "float", f64::NAN);
            if double {
                file.names.iter_mut().for_each(|(_, kind)| *kind = "double");
            }
            file
        };
        let columns: Vec<String> = file().names.into_iter().map(|(name, _)| name).collect();
        // By row, then in the order in which properties are looked at: only the row is told for sure.
        let mut bad: BTreeMap<usize, BTreeSet<String>> = BTreeMap::new();
        let poison = |file: &mut File, bad: &mut BTreeMap<usize, BTreeSet<String>>| {
            for (row, column, kind) in &poisons {
                let (row, column) = (row % rows, column.index(columns.len()));
                let value = POISONS[*kind];
                if columns[column] == "nx" || legal(&columns[column], value) {
                    continue;
                }
                file.rows[row][column] = value;
                bad.entry(row).or_default().insert(format!("{} of row {row} is ", columns[column]));
            }
        };
        let mut poisoned = file();
        poison(&mut poisoned, &mut bad);
        let bytes = poisoned.bytes();
        let bad_rows: BTreeSet<usize> = bad.keys().copied().collect();
        let named = |text: &str| bad.first_key_value().unwrap().1.iter().any(|name| text.contains(name.as_str()));
        match Scene::parse(Path::new("test.ply"), &bytes) {
            Ok(_) => prop_assert!(bad.is_empty()),
            Err(error) => prop_assert!(named(&error.to_string()), "{error}"),
        }
        if bad.len() == rows {
            prop_assert!(reason(&bytes).contains("rows is left") && named(&reason(&bytes)));
            return Ok(());
        }
        let scene = ignoring(&bytes).unwrap();
        prop_assert_eq!(&scene.gaussians, &without(&file().read().unwrap().gaussians, &bad_rows));
        prop_assert_eq!(scene.ignored().map_or(0, |ignored| ignored.count()), bad.len());
        prop_assert!(bad.is_empty() || named(scene.ignored().unwrap().first()));
        prop_assert!(written(&scene, &scene.gaussians.sh) == bytes);

        // Other colours for other rows, and nothing else.
        let mut sh = scene.gaussians.sh.clone();
        let stride = sh.per_gaussian();
        let good: Vec<usize> = (0..rows).filter(|row| !bad.contains_key(row)).collect();
        let mut expected = poisoned;
        for (value, place) in changes {
            let (row, channel) = (place % good.len(), place % 3);
            // Halves of odd numbers: no such colour was there, and text has them as any program writes them.
            let value = f64::from(value) + 0.5;
            sh.coefficients[row * stride + channel] = value as f32;
            let column = expected.column(&format!("f_dc_{channel}"));
            expected.rows[good[row]][column] = value;
        }
        let out = written(&scene, &sh);
        prop_assert!(out == expected.bytes());
        let again = ignoring(&out).unwrap();
        prop_assert_eq!(&again.gaussians.sh, &sh);
        prop_assert_eq!(again.ignored(), scene.ignored());
    }
}

#[test]
fn the_first_is_told_with_property_and_value() {
    for encoding in ENCODINGS {
        let file = File::new(encoding, 1, 5)
            .with("f_rest_4", 3, f64::NAN)
            .with("scale_1", 1, f64::INFINITY);
        let scene = ignoring(&file.bytes()).unwrap();
        let told = scene.ignored().unwrap().to_string();
        assert_eq!(told, "2 rows ignored, the first since property scale_1 of row 1 is inf");
        assert_eq!(scene.gaussians.len(), 3);
    }
}

/// What single precision can't hold is as infinite as what is.
#[test]
fn doubles_beyond_single_precision_are_bad() {
    let mut file = File::new(Encoding::Little, 0, 2).with("y", 1, 1e39);
    file.names.iter_mut().for_each(|(_, kind)| *kind = "double");
    let scene = ignoring(&file.bytes()).unwrap();
    assert_eq!(scene.ignored().unwrap().first(), "property y of row 1 is inf");
    assert!(written(&scene, &scene.gaussians.sh) == file.bytes());
}

/// Some programs write NaN in words of their own; where a row ends is in no doubt.
#[test]
fn words_that_are_no_numbers_are_bad_and_missing_ones_are_damage() {
    let text = |row: &str| {
        let bytes = File::new(Encoding::Ascii, 0, 3).bytes();
        let text = String::from_utf8(bytes).unwrap();
        let mut lines: Vec<&str> = text.lines().collect();
        let second = lines.len() - 2;
        lines[second] = row;
        lines.join("\n").into_bytes()
    };
    let whole = text("1 2 -nan(ind) 0 0 0 1 -1 -1 -1 1 0 0 0");
    let scene = ignoring(&whole).unwrap();
    let first = r#"property z of row 1 is "-nan(ind)", not a number"#;
    assert_eq!((scene.gaussians.len(), scene.ignored().unwrap().first()), (2, first));
    assert!(written(&scene, &scene.gaussians.sh) == whole);
    let short = text("1 2 nan 0 0 0 1 -1 -1 -1 1 0 0");
    assert!(reason(&short).contains("row 1 has 13 values, not 14"));
}

/// Bands that nobody but a bad row uses are not in memory, and stay in the file.
#[test]
fn bands_of_bad_rows_are_not_used() {
    for encoding in ENCODINGS {
        let mut file = File::new(encoding, 2, 3);
        for i in 0..rest_count(2) {
            let column = file.column(&format!("f_rest_{i}"));
            file.rows.iter_mut().for_each(|row| row[column] = 0.0);
        }
        let file = file.with("f_rest_7", 1, 0.5).with("x", 1, f64::NAN);
        let scene = ignoring(&file.bytes()).unwrap();
        assert_eq!(scene.gaussians.sh.degree, 0);
        let mut sh = scene.gaussians.sh.clone();
        sh.coefficients[3] = -0.5;
        assert!(written(&scene, &sh) == file.with("f_dc_0", 2, -0.5).bytes());
    }
}
