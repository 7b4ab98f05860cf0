//! Headers as other trainers than the reference implementation write them: other orders, comments, no normals, integers.
use super::*;
use crate::MAX_DEGREE;
use crate::convert::tests::random;
use crate::{Gaussians, Sh};

/// A property of a row: its type and the bytes that a Gaussian has for it.
type Column = (String, &'static str, Box<dyn Fn(&Gaussians, usize) -> Vec<u8>>);

fn float(name: impl Into<String>, value: impl Fn(&Gaussians, usize) -> f32 + 'static) -> Column {
    (
        name.into(),
        "float",
        Box::new(move |all, row| value(all, row).to_le_bytes().to_vec()),
    )
}

fn axes(names: [&str; 3], value: fn(&Gaussians, usize) -> [f32; 3]) -> Vec<Column> {
    (0..3)
        .map(|i| float(names[i], move |all, row| value(all, row)[i]))
        .collect()
}

fn position() -> Vec<Column> {
    axes(["x", "y", "z"], |all, row| all.positions[row])
}

fn scale() -> Vec<Column> {
    axes(["scale_0", "scale_1", "scale_2"], |all, row| all.log_scales[row])
}

fn normals() -> Vec<Column> {
    axes(["nx", "ny", "nz"], |_, _| [0.0; 3])
}

fn rotation() -> Vec<Column> {
    (0..4)
        .map(|i| float(format!("rot_{i}"), move |all, row| all.rotations[row][i]))
        .collect()
}

fn opacity() -> Vec<Column> {
    vec![float("opacity", |all, row| all.opacity_logits[row])]
}

fn constants() -> Vec<Column> {
    let value = |i: usize| move |all: &Gaussians, row: usize| all.sh.coefficients[row * all.sh.per_gaussian() + i];
    (0..3).map(|i| float(format!("f_dc_{i}"), value(i))).collect()
}

/// Channel after channel, in the order of numbers or of letters.
fn rest(degree: usize, by_letters: bool) -> Vec<Column> {
    let each = (degree + 1) * (degree + 1) - 1;
    let mut numbers: Vec<usize> = (0..3 * each).collect();
    if by_letters {
        numbers.sort_by_key(ToString::to_string);
    }
    let value = move |i: usize| {
        move |all: &Gaussians, row: usize| {
            all.sh.coefficients[row * all.sh.per_gaussian() + 3 + 3 * (i % each) + i / each]
        }
    };
    numbers
        .into_iter()
        .map(|i| float(format!("f_rest_{i}"), value(i)))
        .collect()
}

fn file(comments: &[&str], columns: &[Column], all: &Gaussians) -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\n".to_vec();
    for comment in comments {
        bytes.extend(format!("comment {comment}\n").bytes());
    }
    bytes.extend(format!("element vertex {}\n", all.len()).bytes());
    for (name, kind, _) in columns {
        bytes.extend(format!("property {kind} {name}\n").bytes());
    }
    bytes.extend(b"end_header\n");
    for row in 0..all.len() {
        bytes.extend(columns.iter().flat_map(|(_, _, value)| value(all, row)));
    }
    bytes
}

/// Reads a file of these Gaussians, writes it, and marks it.
fn check(what: &str, bytes: &[u8], all: &Gaussians) {
    let scene = Scene::parse(Path::new(what), bytes).unwrap();
    assert_eq!(&scene.gaussians, all, "{what}");
    let write = |sh: &Sh| {
        let mut out = Vec::new();
        scene.encode(sh, &mut out).unwrap();
        out
    };
    assert!(write(&all.sh) == bytes, "{what}");
    let mut sh = all.sh.clone();
    sh.coefficients.iter_mut().for_each(|value| *value += 0.125);
    let new = write(&sh);
    assert_eq!(Scene::parse(Path::new(what), &new).unwrap().gaussians.sh, sh, "{what}");
    assert_eq!(new.len(), bytes.len());
    let (start, colours) = colours(bytes);
    let row = (bytes.len() - start) / all.len();
    for (i, (old, new)) in bytes.iter().zip(&new).enumerate() {
        let column = i.checked_sub(start).map(|place| place % row);
        let may_change = column.is_some_and(|column| colours[column]);
        assert!(old == new || may_change, "{what}: byte {i}");
    }
}

/// Where the rows of a file begin, and which bytes of one are colours, by the header alone.
fn colours(bytes: &[u8]) -> (usize, Vec<bool>) {
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&bytes[..start]).unwrap();
    let properties = header.lines().filter_map(|line| line.strip_prefix("property "));
    let each = properties.flat_map(|property| {
        let (kind, name) = property.split_once(' ').unwrap();
        let size = if kind == "uchar" { 1 } else { 4 };
        vec![name.starts_with("f_dc_") || name.starts_with("f_rest_"); size]
    });
    (start, each.collect())
}

/// With normals and without, as forks leave them out; of degree 0 without `f_rest_*`.
#[test]
fn splats_of_the_reference_implementation() {
    for degree in [0, 1, 2, 3] {
        let all = random(20, degree, 79);
        for normals in [normals(), Vec::new()] {
            let columns = [
                position(),
                normals,
                constants(),
                rest(degree, false),
                opacity(),
                scale(),
                rotation(),
            ];
            let columns: Vec<Column> = columns.into_iter().flatten().collect();
            check("3DGS", &file(&[], &columns, &all), &all);
        }
    }
}

/// Its plain files have no normals; its compressed ones an element `sh` also where that holds nothing.
#[test]
fn splats_of_gsplat() {
    for degree in [0, 3] {
        let all = random(20, degree, 84);
        let columns = [
            position(),
            constants(),
            rest(degree, false),
            opacity(),
            scale(),
            rotation(),
        ];
        let columns: Vec<Column> = columns.into_iter().flatten().collect();
        check("gsplat", &file(&[], &columns, &all), &all);
    }
    let mut packed = Vec::new();
    let all = random(20, 0, 85);
    crate::convert::convert(&all, crate::Format::CompressedPly, Path::new("gsplat"), &mut packed).unwrap();
    let expected = Scene::parse(Path::new("gsplat"), &packed).unwrap().gaussians;
    let end = packed.windows(10).position(|w| w == b"end_header").unwrap();
    packed.splice(end..end, *b"element sh 20\n");
    let scene = Scene::parse(Path::new("gsplat"), &packed).unwrap();
    assert_eq!(scene.gaussians, expected);
    let mut out = Vec::new();
    scene.encode(&scene.gaussians.sh, &mut out).unwrap();
    assert!(out == packed);
}

#[test]
fn splats_of_nerfstudio() {
    for degree in [0, 3] {
        let all = random(20, degree, 80);
        let columns = [
            position(),
            normals(),
            constants(),
            rest(degree, false),
            opacity(),
            scale(),
            rotation(),
        ];
        let comments = ["Generated by Nerstudio 1.1.5", "Vertical Axis: z"];
        check(
            "nerfstudio",
            &file(&comments, &columns.into_iter().flatten().collect::<Vec<_>>(), &all),
            &all,
        );
    }
}

#[test]
fn splats_of_postshot() {
    // With and without the normals that it wrote once, and of every degree it trains.
    for degree in 0..=MAX_DEGREE {
        let all = random(20, degree, 81);
        for normals in [normals(), Vec::new()] {
            let columns = [
                position(),
                normals,
                constants(),
                rest(degree, false),
                opacity(),
                scale(),
                rotation(),
            ];
            check(
                "Postshot",
                &file(&[], &columns.into_iter().flatten().collect::<Vec<_>>(), &all),
                &all,
            );
        }
    }
}

#[test]
fn splats_of_brush() {
    let all = random(20, 3, 82);
    let comments = [
        "Exported from Brush",
        "Vertical axis: 0 1 0",
        "SH degree: 3",
        "SplatRenderMode: default",
    ];
    for columns in [
        [position(), scale(), opacity(), rotation(), constants(), rest(3, false)],
        [constants(), rest(3, true), opacity(), rotation(), scale(), position()],
    ] {
        check(
            "Brush",
            &file(&comments, &columns.into_iter().flatten().collect::<Vec<_>>(), &all),
            &all,
        );
    }
}

/// Colours as bytes, which nerfstudio writes where it is asked to, are none of a Gaussian; beside others they stay.
#[test]
fn plain_colours_are_no_harmonics() {
    let all = random(20, 0, 83);
    let plain = || {
        ["red", "green", "blue"].map(|name| -> Column { (name.into(), "uchar", Box::new(|_, row| vec![row as u8])) })
    };
    let geometry = || [position(), opacity(), scale(), rotation()].into_iter().flatten();
    let with: Vec<Column> = geometry().chain(plain()).chain(constants()).collect();
    check("both", &file(&[], &with, &all), &all);
    let without: Vec<Column> = geometry().chain(plain()).collect();
    let reason = Scene::parse(Path::new("plain"), &file(&[], &without, &all))
        .unwrap_err()
        .to_string();
    assert!(reason.contains("no property f_dc_0"), "{reason}");
}
