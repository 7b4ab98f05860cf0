//! Rows that stand for no numbers, left out where that was asked for.
use super::*;
use crate::BadRows;
use crate::ignored::tests::without;
use proptest::prelude::*;
use std::collections::BTreeSet;

fn ignoring(bytes: &[u8]) -> Result<Scene> {
    Scene::parse_with(Path::new("test.sog"), bytes, BadRows::Ignore)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn bad_rows_are_counted_and_never_change(
        bands in 0..3usize,
        rows in 1..9usize,
        quats in prop::collection::btree_set(0..9usize, 0..3),
        labels in prop::collection::btree_set(0..9usize, 0..3),
        shift in -2.0..2.0f32,
    ) {
        let good = File::new(2, bands, rows);
        let (mut file, mut bad) = (good.clone(), BTreeSet::new());
        for row in quats.into_iter().filter(|row| *row < rows) {
            file.pixels("quats")[row][3] = 251;
            bad.insert(row);
        }
        for row in labels.into_iter().filter(|row| *row < rows && bands > 0) {
            file.pixels("shN_labels")[row] = [PALETTE as u8, 0, 0, 255];
            bad.insert(row);
        }
        let bytes = file.bytes();
        prop_assert_eq!(read(&bytes).is_ok(), bad.is_empty());
        if bad.len() == rows {
            prop_assert!(ignoring(&bytes).unwrap_err().to_string().contains("rows is left"));
            return Ok(());
        }
        let scene = ignoring(&bytes).unwrap();
        prop_assert_eq!(&scene.gaussians, &without(&good.read().unwrap().gaussians, &bad));
        prop_assert_eq!(scene.ignored().map_or(0, |ignored| ignored.count()), bad.len());
        prop_assert!(written(&scene, &scene.gaussians.sh) == bytes);

        let sh = changed(&scene, |_, value| value + shift);
        let again = ignoring(&written(&scene, &sh)).unwrap();
        prop_assert_eq!(bits(&again.gaussians.sh.coefficients), bits(&sh.coefficients));
        prop_assert_eq!(again.ignored(), scene.ignored());
        let mut picture = unzip(&written(&scene, &sh));
        picture.retain(|(name, _)| name == "sh0");
        let colours = super::super::Picture::decode(picture.remove(0).1, |_| Ok(())).unwrap();
        for row in bad {
            prop_assert_eq!(colours.texel(row), file.pixels("sh0")[row]);
        }
    }
}

/// The numbers of a table are shared, and yet those that are missing concern the rows that have them.
#[test]
fn rows_of_missing_numbers_are_bad() {
    for (name, table) in [("scales", "scales"), ("sh0", "sh0"), ("shN_centroids", "shN")] {
        let good = File::new(2, 1, 6);
        let mut file = good.clone();
        let index = 201;
        // An index that only row 4 has: by itself, or by its place in the palette.
        for (texel, i) in file.pixels(name).iter_mut().zip(0..) {
            for byte in &mut texel[..3] {
                *byte = if *byte == index { 7 } else { *byte };
            }
            if name != "shN_centroids" && i == 4 {
                texel[1] = index;
            }
        }
        if name == "shN_centroids" {
            file.pixels(name)[3 * 69 + 2][1] = index;
            for (row, texel) in file.pixels("shN_labels").iter_mut().enumerate() {
                *texel = [if row == 4 { 69 } else { row as u8 }, 0, 0, 255];
            }
        }
        let whole = file.read().unwrap().gaussians;
        let file = file.with(&format!("/{table}/codebook/{index}"), Value::Null);
        assert!(
            file.refused()
                .contains(&format!("index 201, which {table}.codebook has no number for"))
        );
        let scene = ignoring(&file.bytes()).unwrap();
        assert_eq!(scene.gaussians, without(&whole, &BTreeSet::from([4])), "{name}");
        assert!(scene.ignored().unwrap().to_string().contains("1 row ignored: row 4"));
    }
}

/// What all rows share is refused.
#[test]
fn shared_numbers_are_refused_all_the_same() {
    let reason = |file: &File| ignoring(&file.bytes()).unwrap_err().to_string();
    let file = || File::new(2, 0, 5);
    assert!(reason(&file().with("/means/maxs/1", json!(88.5))).contains("limit 88"));
    assert!(reason(&file().with("/sh0/codebook/3", json!(1e39))).contains("too large for single precision"));
}
