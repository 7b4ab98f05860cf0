//! Tests of files of all levels, made by hand: sections, buckets, rows.
use super::*;
use crate::convert::tests::random;
use crate::summary::tests::agrees;
use crate::{Error, Format, HEAD, Scene, sniff};
use proptest::prelude::*;

/// A section that is to be written: buckets of one size that are full, then others.
struct Part {
    degree: usize,
    full: u32,
    bucket: u32,
    partial: Vec<u32>,
}

impl Part {
    fn rows(&self) -> u32 {
        self.full * self.bucket + self.partial.iter().sum::<u32>()
    }
}

const BLOCK: f32 = 4.0;

/// The centre of a bucket of a section.
fn centre(section: usize, bucket: usize) -> [f32; 3] {
    [10.0 * section as f32, bucket as f32, -1.5]
}

fn put(bytes: &mut [u8], at: usize, number: u32) {
    bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
}

/// A file of a level, whose rows are numbered through all sections.
fn file(level: u8, parts: &[Part]) -> Vec<u8> {
    let total: u32 = parts.iter().map(Part::rows).sum();
    let mut header = vec![0; HEADER];
    header[1] = 1;
    header[20] = level;
    for (at, number) in [
        (4, parts.len() as u32),
        (8, parts.len() as u32),
        (12, total),
        (16, total),
    ] {
        put(&mut header, at, number);
    }
    put(&mut header, 36, (-0.5f32).to_bits());
    put(&mut header, 40, 2.05f32.to_bits());
    let (mut bodies, mut row) = (Vec::new(), 0);
    for (i, part) in parts.iter().enumerate() {
        let buckets = part.full as usize + part.partial.len();
        let mut section = vec![0; SECTION];
        section[40] = part.degree as u8;
        let (counts, packed) = ([(0, part.rows()), (4, part.rows())], level > 0);
        let others = [
            (8, part.bucket),
            (12, buckets as u32),
            (16, BLOCK.to_bits()),
            (20, 12),
            (24, 1000),
            (32, part.full),
            (36, part.partial.len() as u32),
        ];
        for (at, number) in counts.into_iter().chain(others.into_iter().filter(|_| packed)) {
            put(&mut section, at, number);
        }
        if packed {
            bodies.extend(part.partial.iter().flat_map(|length| length.to_le_bytes()));
            let centres = (0..buckets).flat_map(|bucket| centre(i, bucket));
            bodies.extend(centres.flat_map(f32::to_le_bytes));
        }
        for _ in 0..part.rows() {
            bodies.extend(row_of(level, part.degree, row));
            row += 1;
        }
        header.extend(section);
    }
    header.extend(bodies);
    header
}

/// Harmonic `i` of row `row`, which all levels have: a step of 0.01 from -0.5, and a fraction of eighths nearly.
fn harmonic(row: u32, i: usize) -> f32 {
    0.25 * ((row as usize + i) % 9) as f32 - 0.5
}

fn row_of(level: u8, degree: usize, row: u32) -> Vec<u8> {
    let scales = [1.0, 0.25 + row as f32, 0.0];
    let turn = [0.5, -0.5, 0.5, -0.5];
    let mut bytes = Vec::new();
    match level {
        0 => {
            let position = [row as f32, -2.0, 3.5];
            bytes.extend(
                position
                    .into_iter()
                    .chain(scales)
                    .chain(turn)
                    .flat_map(f32::to_le_bytes),
            );
        }
        _ => {
            let steps = [1000 + row as u16, 0, 2000];
            bytes.extend(steps.into_iter().flat_map(u16::to_le_bytes));
            let halves = scales.into_iter().chain(turn).map(half::nearest);
            bytes.extend(halves.flat_map(u16::to_le_bytes));
        }
    }
    bytes.extend([row as u8, 51, 255, 204]);
    for i in 0..rest_count(degree) {
        match level {
            0 => bytes.extend(harmonic(row, i).to_le_bytes()),
            1 => bytes.extend(half::nearest(harmonic(row, i)).to_le_bytes()),
            _ => bytes.push((100.0 * (harmonic(row, i) + 0.5)) as u8),
        }
    }
    bytes
}

/// Two sections: one of two full buckets of three and two others, of degree 2; one of a single bucket, of degree 1.
fn usual(level: u8) -> Vec<u8> {
    let first = Part {
        degree: 2,
        full: 2,
        bucket: 3,
        partial: vec![2, 1],
    };
    let second = Part {
        degree: 1,
        full: 0,
        bucket: 256,
        partial: vec![2],
    };
    file(level, &[first, second])
}

/// Where the rows of [`usual`] are, and their colours within them.
fn places(level: u8) -> Vec<(usize, usize, usize)> {
    let how = [Level::Single, Level::Half, Level::Byte][usize::from(level)];
    let buckets = |count: usize, partial: usize| if level == 0 { 0 } else { 12 * count + 4 * partial };
    let mut at = HEADER + 2 * SECTION + buckets(4, 2);
    let mut all = Vec::new();
    for row in 0..11 {
        let degree = if row < 9 { 2 } else { 1 };
        if row == 9 {
            at += buckets(1, 1);
        }
        all.push((at, at + how.geometry(), at + how.row(degree)));
        at += how.row(degree);
    }
    all
}

fn read(bytes: &[u8]) -> Result<Scene> {
    let scene = Scene::parse(Path::new("test.ksplat"), bytes)?;
    agrees(bytes, &scene);
    assert_eq!(
        sniff(&bytes[..bytes.len().min(HEAD)], bytes.len() as u64),
        Some(Format::Ksplat)
    );
    Ok(scene)
}

fn refused(bytes: &[u8]) -> String {
    match Scene::parse(Path::new("test.ksplat"), bytes) {
        Err(Error::BadScene { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let mut out = Vec::new();
    scene.encode(sh, &mut out).unwrap();
    out
}

#[test]
fn every_level_is_read() {
    for level in 0..3 {
        let bytes = [usual(level), b"more".to_vec()].concat();
        let scene = read(&bytes).unwrap();
        assert_eq!(
            (scene.format(), scene.exact(), scene.learnable_degree()),
            (Format::Ksplat, false, 2)
        );
        let g = &scene.gaussians;
        assert_eq!((g.len(), g.sh.degree), (11, 2));
        // Buckets of 3, 3, 2, 1 rows and one of 2, all sides 4 long and 1000 steps from centre to side.
        let buckets = [0, 0, 0, 1, 1, 1, 2, 2, 3, 0, 0];
        for (row, bucket) in buckets.into_iter().enumerate() {
            let [x, y, z] = centre(usize::from(row > 8), bucket);
            let expected = match level {
                0 => [row as f32, -2.0, 3.5],
                _ => [x + 0.002 * row as f32, y - 2.0, z + 2.0],
            };
            for (found, expected) in g.positions[row].into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "row {row} of level {level}: {found}");
            }
            assert_eq!(g.rotations[row], [0.5, -0.5, 0.5, -0.5]);
            let log = f64::from(0.25 + row as f32).ln() as f32;
            assert_eq!(g.log_scales[row], [0.0, log, f32::NEG_INFINITY]);
            assert_eq!(g.opacity_logits[row], 1.386_294_4);
            let colour = &g.sh.coefficients[27 * row..][..27];
            assert_eq!(colour[1..3], [-1.063_472_3, 1.772_453_9]);
            // Green of coefficient 2 of band 1, blue of coefficient 4 of band 2.
            assert!((colour[3 + 3 * 2 + 1] - harmonic(row as u32, 3 + 2)).abs() < 1e-6);
            let last = if row < 9 { harmonic(row as u32, 9 + 10 + 4) } else { 0.0 };
            assert!((colour[26] - last).abs() < 1e-6);
        }
        assert!(written(&scene, &g.sh) == bytes);
    }
}

proptest! {
    #[test]
    fn a_write_changes_colours_and_nothing_else(
        level in 0..3u8,
        changes in prop::collection::vec(crate::range::tests::wild(), 11 * 27),
        poisoned in prop::option::of(0..11usize),
    ) {
        let mut bytes = usual(level);
        let places = places(level);
        if let Some(row) = poisoned {
            let (start, ..) = places[row];
            // The first scale is NaN.
            match level {
                0 => put(&mut bytes, start + 12, f32::NAN.to_bits()),
                _ => bytes[start + 6..start + 8].copy_from_slice(&0x7e00u16.to_le_bytes()),
            }
            let reason = refused(&bytes);
            prop_assert!(reason.contains(&format!("property scale_0 of row {row} is NaN")), "{}", reason);
        }
        let scene = Scene::parse_with(Path::new("it"), &bytes, BadRows::Ignore).unwrap();
        let own = &scene.gaussians.sh;
        prop_assert_eq!(scene.gaussians.len(), 11 - usize::from(poisoned.is_some()));
        let sh = Sh { degree: own.degree, coefficients: changes[..own.coefficients.len()].to_vec() };
        let out = written(&scene, &sh);
        let mut kept = sh.clone();
        kept.coefficients.chunks_exact_mut(27).enumerate().for_each(|(i, row)| scene.quantize_colors(i, row));
        let again = Scene::parse_with(Path::new("it"), &out, BadRows::Ignore).unwrap().gaussians;
        prop_assert_eq!(&again.positions, &scene.gaussians.positions);
        prop_assert_eq!(&again.log_scales, &scene.gaussians.log_scales);
        prop_assert_eq!(&again.sh.coefficients, &kept.coefficients);
        let mut may = vec![false; bytes.len()];
        for (row, (_, colour, end)) in places.into_iter().enumerate() {
            may[colour..end].fill(poisoned != Some(row));
            may[colour + 3] = false;
        }
        prop_assert_eq!(out.len(), bytes.len());
        prop_assert!((0..out.len()).all(|i| may[i] || out[i] == bytes[i]));
    }

    #[test]
    fn what_is_cut_or_changed_is_read_or_refused(level in 0..3u8, cut in 0..7000usize, at in 0..6500usize, byte in any::<u8>()) {
        let mut bytes = usual(level);
        let end = cut.min(bytes.len());
        if end < bytes.len() && end >= 24 {
            prop_assert!(refused(&bytes[..end]).contains("truncated"));
        }
        if let Some(place) = bytes.get_mut(at) {
            *place = byte;
        }
        let _ = Scene::parse_with(Path::new("it"), &bytes, BadRows::Ignore);
    }
}

#[test]
fn wrong_headers_are_refused_with_field_and_limit() {
    // Offsets in the header of the file, and in that of the second section.
    let second = HEADER + SECTION;
    for (at, number, reason) in [
        (0, 0x200, "version 0.2; known is 0.1"),
        (4, 3, "2 of 3 sections are there"),
        (12, 12, "11 of 12 Gaussians are there"),
        (20, 3, "compression level 3; known are 0, 1 and 2"),
        (36, f32::INFINITY.to_bits(), "the least harmonic is inf"),
        (second, 1, "section 1: 1 of 2 Gaussians are there"),
        (
            second + 40,
            3,
            "section 1: spherical harmonics of degree 3; the limit is 2",
        ),
        (second + 20, 16, "section 1: buckets have 16 bytes, must have 12"),
        (second + 12, 0, "section 1: 0 buckets, of which 0 full and 1 others"),
        (second + 16, f32::NAN.to_bits(), "section 1: the side of buckets is NaN"),
        (second + 32, 1, "section 1: 1 buckets, of which 1 full and 1 others"),
        (second + 12, 1 << 30, "truncated: section 1 ends at byte"),
        (
            second + SECTION,
            7,
            "section 0: buckets of 14 Gaussians, and 9 Gaussians",
        ),
        (
            second + SECTION + 8,
            f32::NAN.to_bits(),
            "section 0: the centre of bucket 0 is [NaN",
        ),
    ] {
        let mut bytes = usual(1);
        put(&mut bytes, at, number);
        let told = refused(&bytes);
        assert!(
            told.starts_with("a .ksplat: ") && told.contains(reason),
            "{told}, not {reason}"
        );
    }
    let mut negative = usual(0);
    let (start, ..) = places(0)[10];
    put(&mut negative, start + 16, (-1.0f32).to_bits());
    assert_eq!(refused(&negative), "a .ksplat: the scale of row 10 along axis 1 is -1");
}

#[test]
fn harmonics_have_a_range_even_where_none_was_written() {
    let mut bytes = usual(2);
    put(&mut bytes, 36, 0);
    put(&mut bytes, 40, f32::NAN.to_bits());
    let (_, colour, _) = places(2)[0];
    bytes[colour + 4..colour + 6].copy_from_slice(&[0, 255]);
    let sh = read(&bytes).unwrap().gaussians.sh;
    assert_eq!((sh.coefficients[3], sh.coefficients[6]), (-1.5, 1.5));
}

#[test]
fn a_head_may_end_before_the_headers_of_all_sections() {
    let part = |rows| Part {
        degree: 0,
        full: 0,
        bucket: 0,
        partial: vec![rows],
    };
    let parts: Vec<Part> = (0..100).map(|i| part(i % 3)).collect();
    let bytes = file(1, &parts);
    let said = crate::summary(Path::new("it"), &bytes[..HEAD], bytes.len() as u64).unwrap();
    assert_eq!(said.map(|said| (said.gaussians, said.degree)), Some((99, 2)));
    assert_eq!(read(&bytes).unwrap().gaussians.len(), 99);
}

#[test]
fn other_files_are_not_taken_for_one() {
    // A TrueType font, a .splat of zeros, and numbers of sections that nobody has.
    let font = [&[0, 1, 0, 0, 0, 15, 0, 128, 0, 3][..], &[0; 30]].concat();
    assert!(!detect(&font) && !detect(&[0; 64]) && !detect(&[0, 1, 0, 0]));
    let mut many = usual(0);
    put(&mut many, 4, u32::MAX);
    assert!(!detect(&many));
}

#[test]
fn what_convert_writes_is_as_exact_as_single_precision() {
    let scene = random(300, 3, 4);
    let mut bytes = Vec::new();
    let written = crate::convert::convert(&scene, Format::Ksplat, Path::new("it"), &mut bytes).unwrap();
    assert_eq!(written.degree, 2);
    let back = read(&bytes).unwrap().gaussians;
    assert_eq!(back.positions, scene.positions);
    for row in 0..300 {
        let (mine, theirs) = (&scene.sh.coefficients[48 * row..], &back.sh.coefficients[27 * row..]);
        assert_eq!(mine[3..27], theirs[3..27], "row {row}");
    }
}
