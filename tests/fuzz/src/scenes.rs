//! Scenes of all formats: what is read holds together, agrees with what its first bytes said, and is written back.
use crate::memory::bounded;
use flate2::Compression;
use flate2::write::GzEncoder;
use guardsplat_scene::{Format, HEAD, MAX_DEGREE, Scene, Sh, sniff, summary as summarise};
use std::io::Write;
use std::path::Path;

/// Plain PLYs.
pub fn ply(data: &[u8]) {
    if data.starts_with(b"ply") {
        scene(data);
    }
}

/// Compressed PLYs.
pub fn compressed_ply(data: &[u8]) {
    ply(data);
}

/// SPZ of all versions. The content of versions 2 and 3 may be given without gzip around it, through whose checksum no
/// change would get.
pub fn spz(data: &[u8]) {
    if data.starts_with(b"NGSP") && matches!(data.get(4), Some(2 | 3)) {
        let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
        if let Ok(packed) = gzip.write_all(data).and_then(|()| gzip.finish()) {
            scene(&packed);
        }
    }
    if data.starts_with(b"NGSP") || data.starts_with(b"\x1f\x8b") {
        scene(data);
    }
}

/// glTF, as JSON and binary. A JSON with a 0 behind it and a buffer behind that is also put into a binary file, whose
/// lengths no change would get right.
pub fn gltf(data: &[u8]) {
    if !data.starts_with(b"{") && !data.starts_with(b"glTF") {
        return;
    }
    if let Some(end) = data.iter().position(|byte| *byte == 0).filter(|_| data[0] == b'{') {
        scene(&glb(&data[..end], &data[end + 1..]));
    }
    scene(data);
}

/// A binary glTF.
fn glb(json: &[u8], buffer: &[u8]) -> Vec<u8> {
    let mut chunks = Vec::new();
    for (kind, data, fill) in [(b"JSON", json, b' '), (b"BIN\0", buffer, 0)] {
        let length = data.len().next_multiple_of(4);
        chunks.extend((length as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(data);
        chunks.resize(chunks.len() + length - data.len(), fill);
    }
    [
        b"glTF\x02\0\0\0",
        &(12 + chunks.len() as u32).to_le_bytes()[..],
        &chunks,
    ]
    .concat()
}

/// Rows of 32 bytes.
pub fn splat(data: &[u8]) {
    scene(data);
}

/// Sections of rows. A level, a degree and rows are also put behind headers that are right, which few changes would leave so.
pub fn ksplat(data: &[u8]) {
    if let [level, degree, rows @ ..] = data {
        scene(&of_rows(level % 3, degree % 3, rows));
    }
    scene(data);
}

/// A file of one section, and of one bucket where the level has any.
fn of_rows(level: u8, degree: u8, rows: &[u8]) -> Vec<u8> {
    let harmonics = 3 * ((usize::from(degree) + 1).pow(2) - 1);
    let row = match level {
        0 => 44 + 4 * harmonics,
        1 => 24 + 2 * harmonics,
        _ => 24 + harmonics,
    };
    let count = (rows.len() / row) as u32;
    let mut file = vec![0; 4096 + 1024];
    (file[1], file[20], file[4096 + 40]) = (1, level, degree);
    let mut numbers = vec![(4, 1), (8, 1), (12, count), (16, count), (4096, count), (4100, count)];
    if level > 0 {
        let bucket = [(8, 256), (12, 1), (16, 5f32.to_bits()), (20, 12), (24, 32_767), (36, 1)];
        numbers.extend(bucket.map(|(at, number)| (4096 + at, number)));
        file.extend(count.to_le_bytes());
        file.extend([0; 12]);
    }
    for (at, number) in numbers {
        file[at..at + 4].copy_from_slice(&number.to_le_bytes());
    }
    file.extend(rows);
    file
}

/// Whatever bytes a file may have that somebody calls a scene.
pub fn scene(data: &[u8]) {
    if let Some(scene) = read(data) {
        check(data, &scene);
    }
}

/// The first bytes of files of any size.
pub fn summary(data: &[u8]) {
    let head = &data[..data.len().min(HEAD)];
    let size = data.len() as u64;
    for size in [size, size + 1, 1 << 40, u64::MAX] {
        let said = bounded(head.len(), || summarise(Path::new("fuzz"), head, size));
        if let Ok(Some(said)) = said {
            assert!(said.least_to_read() <= said.likely_to_read());
            assert!(said.least_to_mark() <= said.likely_to_mark());
            assert!(said.degree <= MAX_DEGREE as u64);
            // A head is all of its file, or as long as heads are.
            if size == data.len() as u64 || head.len() == HEAD {
                assert_eq!(sniff(head, size), Some(said.format));
            }
        }
    }
    if let Some(scene) = read(data) {
        agrees(data, &scene);
    }
}

pub(crate) fn read(data: &[u8]) -> Option<Scene> {
    bounded(data.len(), || Scene::parse(Path::new("fuzz"), data)).ok()
}

pub(crate) fn check(data: &[u8], scene: &Scene) {
    consistent(scene);
    agrees(data, scene);
    same_again(data, scene);
    other_colours(scene);
}

/// Arrays of one length, and numbers that are some.
fn consistent(scene: &Scene) {
    let all = &scene.gaussians;
    let rows = all.len();
    assert_eq!(all.rotations.len(), rows);
    assert_eq!(all.log_scales.len(), rows);
    assert_eq!(all.opacity_logits.len(), rows);
    assert!(all.sh.degree <= MAX_DEGREE && scene.learnable_degree() <= all.sh.degree);
    assert_eq!(all.sh.coefficients.len(), rows * all.sh.per_gaussian());
    assert!(all.positions.as_flattened().iter().all(|v| v.is_finite()));
    assert!(all.rotations.as_flattened().iter().all(|v| v.is_finite()));
    assert!(
        all.log_scales
            .as_flattened()
            .iter()
            .all(|v| v.is_finite() || *v == f32::NEG_INFINITY)
    );
    assert!(all.sh.coefficients.iter().all(|v| v.is_finite()));
    assert!((0..rows).all(|row| (0.0..=1.0).contains(&all.opacity(row))));
}

/// What the first bytes say is what is there.
fn agrees(data: &[u8], scene: &Scene) {
    let head = &data[..data.len().min(HEAD)];
    let format = scene.format();
    // Rows that look like nothing may fill the head of a .splat.
    if format != Format::Splat || head.len() == data.len() {
        assert_eq!(sniff(head, data.len() as u64), Some(format));
        let said = summarise(Path::new("fuzz"), head, data.len() as u64);
        let said = said.expect("a scene that is read is no error before");
        assert_eq!(
            said.is_none(),
            matches!(format, Format::Sog | Format::Gltf | Format::Glb)
        );
        if let Some(said) = said {
            assert_eq!((said.format, said.gaussians), (format, scene.gaussians.len() as u64));
            assert!(said.degree >= scene.gaussians.sh.degree as u64);
            assert!(said.file <= scene.file_bytes() as u64);
        }
    }
}

/// With its own colours a scene is written as the same file; gzip streams are packed again, and hold the same.
fn same_again(data: &[u8], scene: &Scene) {
    let written = written(scene, &scene.gaussians.sh);
    if data.starts_with(b"\x1f\x8b") {
        let again = Scene::parse(Path::new("again"), &written).expect("what is written is read");
        assert_eq!(again.gaussians, scene.gaussians);
    } else {
        assert!(
            written == data,
            "a scene with its own colours is written as another file"
        );
    }
}

/// With other colours a scene is read back as what `keep` said, and everything else is as it was.
fn other_colours(scene: &Scene) {
    let mut sh = scene.gaussians.sh.clone();
    for (i, value) in sh.coefficients.iter_mut().enumerate() {
        *value += [0.37, -0.21, 0.11][i % 3];
    }
    if sh == scene.gaussians.sh {
        return;
    }
    let mut kept = sh.clone();
    for (row, coefficients) in kept.coefficients.chunks_exact_mut(sh.per_gaussian()).enumerate() {
        scene.quantize_colors(row, coefficients);
    }
    if scene.exact() {
        assert_eq!(kept, sh);
    }
    let written = written(scene, &sh);
    // A .splat whose first two rows are text but for a colour may become text, which is read as a glTF. No scene is that.
    let head = &written[..written.len().min(HEAD)];
    if scene.format() == Format::Splat && sniff(head, written.len() as u64) == Some(Format::Gltf) {
        return;
    }
    let again = Scene::parse(Path::new("changed"), &written).expect("what is written is read");
    assert_eq!(again.format(), scene.format());
    let (mine, theirs) = (&scene.gaussians, &again.gaussians);
    assert_eq!(mine.positions, theirs.positions);
    assert_eq!(mine.rotations, theirs.rotations);
    assert_eq!(mine.log_scales, theirs.log_scales);
    assert_eq!(mine.opacity_logits, theirs.opacity_logits);
    if kept != scene.gaussians.sh {
        same_colours(&kept, &theirs.sh);
    }
}

/// Bands of zeros may be left out on either side.
fn same_colours(a: &Sh, b: &Sh) {
    let rows = a.coefficients.chunks_exact(a.per_gaussian());
    for (row, (a, b)) in rows.zip(b.coefficients.chunks_exact(b.per_gaussian())).enumerate() {
        for place in 0..a.len().max(b.len()) {
            let at = |row: &[f32]| row.get(place).copied().unwrap_or(0.0);
            assert_eq!(at(a), at(b), "coefficient {place} of row {row}");
        }
    }
}

fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let mut bytes = Vec::new();
    scene.encode(sh, &mut bytes).expect("memory takes what is written");
    bytes
}
