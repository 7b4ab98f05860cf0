//! Scenes: PLY, compressed PLY, SPZ, glTF, .splat, .ksplat.
use super::{put, put_damaged};
use flate2::Compression;
use flate2::write::GzEncoder;
use guardsplat_scene::convert::convert;
use guardsplat_scene::{Format, Gaussians, Sh};
use std::io::Write;
use std::path::Path;

pub fn put_all() {
    plain();
    packed();
    spz();
    splat();
    ksplat();
    gltf();
}

const NAMES: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
    "rot_3",
];

/// A header of so many Gaussians and rest coefficients.
fn header(encoding: &str, kind: &str, rows: &str, rest: usize) -> String {
    let mut text = format!("ply\nformat {encoding} 1.0\ncomment a seed\nelement vertex {rows}\n");
    for name in NAMES {
        text += &format!("property {kind} {name}\n");
    }
    for i in 0..rest {
        text += &format!("property float f_rest_{i}\n");
    }
    text + "end_header\n"
}

fn values(rows: usize, columns: usize) -> impl Iterator<Item = f32> + Clone {
    (0..rows * columns).map(|i| (i * 7 % 23) as f32 / 8.0 - 1.0)
}

fn plain() {
    let little = |rows: &str, rest: usize, there: usize| {
        let mut file = header("binary_little_endian", "float", rows, rest).into_bytes();
        file.extend(values(there, 14 + rest).flat_map(f32::to_le_bytes));
        file
    };
    put_damaged("ply", "little-degree-0", &little("3", 0, 3));
    put_damaged("ply", "little-degree-1", &little("2", 9, 2));
    put("ply", "little-degree-3", little("1", 45, 1));
    put("ply", "degree-none", little("1", 10, 1));
    for (name, count) in [
        ("rows-none", "0"),
        ("rows-many", "4294967296"),
        ("rows-most", "18446744073709551615"),
        ("rows-negative", "-1"),
        ("rows-too-many", "99999999999999999999999"),
    ] {
        put("ply", name, little(count, 0, 1));
    }
    let mut big = header("binary_big_endian", "double", "2", 0).into_bytes();
    big.extend(values(2, 14).flat_map(|v| f64::from(v).to_be_bytes()));
    put_damaged("ply", "big-double", &big);
    let mut poisoned = little("2", 0, 2);
    let at = poisoned.len() - 100;
    poisoned[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    put("ply", "nan", &poisoned);
    let row = "0 1 -2.5 .1 .2 .3 inf -1 -inf 0 1 0 0 0\n";
    let ascii = format!("{}{row}\n{row}", header("ascii", "float", "2", 0));
    put_damaged("ply", "ascii", ascii.as_bytes());
    put(
        "ply",
        "ascii-short-row",
        format!("{}0 1 2\n", header("ascii", "float", "1", 0)),
    );
    put(
        "ply",
        "ascii-words",
        format!("{}{}", header("ascii", "float", "1", 0), row.replace("-2.5", "x")),
    );
    put("ply", "crlf", ascii.replace('\n', "\r\n"));
    put(
        "ply",
        "integers",
        header("binary_little_endian", "uchar", "1", 0) + "abcdefghijklmn",
    );
    put(
        "ply",
        "twice",
        header("ascii", "float", "1", 0).replace("property float y", "property float x"),
    );
    let other = "element face 2\nproperty list uchar int vertex_indices\nelement vertex";
    put(
        "ply",
        "list-before",
        header("ascii", "float", "1", 0).replace("element vertex", other) + row,
    );
    let other = "element camera 1\nproperty double f\nelement vertex";
    let other = header("binary_little_endian", "float", "1", 0).replace("element vertex", other);
    put("ply", "element-before", [other.as_bytes(), &[7; 8 + 56]].concat());
    put("ply", "no-end", "ply\nformat ascii 1.0\nelement vertex 1\n");
    for (i, file) in [little("3", 0, 3), ascii.into_bytes(), packed_file(2, 1, true)]
        .iter()
        .enumerate()
    {
        put("scene", &format!("ply-{i}"), file);
        put("summary", &format!("ply-{i}"), file);
    }
}

/// A compressed PLY of one chunk, with bands up to `degree`.
fn packed_file(rows: usize, degree: usize, colours: bool) -> Vec<u8> {
    let mut text = "ply\nformat binary_little_endian 1.0\nelement chunk 1\n".to_string();
    let mut ranges = vec!["x", "y", "z", "scale_x", "scale_y", "scale_z"];
    if colours {
        ranges.extend(["r", "g", "b"]);
    }
    let mut body = Vec::new();
    for (end, value) in [("min", -1.0f32), ("max", 1.5)] {
        for name in &ranges {
            text += &format!("property float {end}_{name}\n");
            body.extend(value.to_le_bytes());
        }
    }
    text += &format!("element vertex {rows}\n");
    for name in ["position", "rotation", "scale", "color"] {
        text += &format!("property uint packed_{name}\n");
    }
    body.extend((0..16 * rows).map(|i| (i * 37 + 11) as u8));
    let rest = 3 * ((degree + 1) * (degree + 1) - 1);
    if rest > 0 {
        text += &format!("element sh {rows}\n");
        for i in 0..rest {
            text += &format!("property uchar f_rest_{i}\n");
        }
        body.extend((0..rest * rows).map(|i| (i * 53) as u8));
    }
    text += "end_header\n";
    [text.into_bytes(), body].concat()
}

fn packed() {
    let target = "compressed_ply";
    put_damaged(target, "colours", &packed_file(3, 0, true));
    put_damaged(target, "no-colours", &packed_file(2, 0, false));
    put_damaged(target, "degree-1", &packed_file(2, 1, true));
    put(target, "degree-2", packed_file(1, 2, true));
    put(target, "none", packed_file(0, 0, true));
    let file = packed_file(2, 1, true);
    let with = |from: &str, to: &str| {
        let at = file
            .windows(from.len())
            .position(|w| w == from.as_bytes())
            .expect("it is in the header");
        [&file[..at], to.as_bytes(), &file[at + from.len()..]].concat()
    };
    put(target, "chunk-too-few", with("vertex 2", "vertex 300"));
    put(target, "chunk-many", with("chunk 1", "chunk 999999999999"));
    put(target, "chunk-most", with("chunk 1", "chunk 18446744073709551615"));
    put(target, "sh-other", with("sh 2", "sh 3"));
    put(target, "ascii", with("binary_little_endian", "ascii"));
    put(target, "tabs", with("uint packed_position", "uint\tpacked_position"));
    put(target, "elsewhere", with("element vertex", "element face"));
    let mut flat = file.clone();
    let start = file.windows(11).position(|w| w == b"end_header\n").expect("it has one") + 11;
    flat[start + 24..start + 28].copy_from_slice(&1e30f32.to_le_bytes());
    put(target, "range-wide", &flat);
    flat[start..start + 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    put(target, "range-infinite", &flat);
}

/// The content of an SPZ: header and sections.
fn content(version: u8, points: u32, degree: u8) -> Vec<u8> {
    let mut bytes = b"NGSP".to_vec();
    bytes.extend([version, 0, 0, 0]);
    bytes.extend(points.to_le_bytes());
    bytes.extend([degree, 12, 0, 0]);
    bytes.extend(
        (0..section_sizes(version, degree).iter().sum::<usize>() * points.min(9) as usize).map(|i| (i * 29) as u8),
    );
    bytes
}

fn section_sizes(version: u8, degree: u8) -> [usize; 6] {
    let degree = usize::from(degree);
    [
        9,
        1,
        3,
        3,
        if version == 2 { 3 } else { 4 },
        3 * ((degree + 1) * (degree + 1) - 1),
    ]
}

fn gzip(content: &[u8]) -> Vec<u8> {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
    gzip.write_all(content)
        .and_then(|()| gzip.finish())
        .expect("memory takes a small stream")
}

/// Version 4: a stream a section.
fn streams(points: u32, degree: u8) -> Vec<u8> {
    let content = content(4, points, degree);
    let (mut file, mut rest) = content.split_at(16);
    let mut toc = Vec::new();
    let mut packed = Vec::new();
    let mut count = 0;
    for size in section_sizes(4, degree)
        .map(|size| size * points as usize)
        .into_iter()
        .filter(|size| *size > 0)
    {
        let (section, after) = rest.split_at(size);
        rest = after;
        let stream = zstd::bulk::compress(section, 3).expect("memory takes a small stream");
        toc.extend((stream.len() as u64).to_le_bytes());
        toc.extend((size as u64).to_le_bytes());
        packed.extend(stream);
        count += 1;
    }
    let mut start = std::mem::take(&mut file).to_vec();
    start[15] = count;
    start.extend(32u32.to_le_bytes());
    start.extend([0; 12]);
    [start, toc, packed].concat()
}

fn spz() {
    for (version, points, degree) in [(2, 3, 0), (2, 2, 1), (3, 3, 3), (3, 1, 4), (3, 0, 0)] {
        let name = format!("v{version}-{points}-degree-{degree}");
        put("spz", &format!("content-{name}"), content(version, points, degree));
        put_damaged("spz", &format!("gzip-{name}"), &gzip(&content(version, points, degree)));
    }
    put("spz", "content-many", content(3, u32::MAX, 3));
    put("spz", "content-degree-9", content(3, 1, 9));
    put("spz", "content-after", [content(2, 1, 0), vec![5; 99]].concat());
    put("spz", "gzip-after", [gzip(&content(2, 1, 0)), vec![5; 9]].concat());
    put(
        "spz",
        "gzip-bomb",
        gzip(&[content(3, 100_000, 3), vec![0; 200_000]].concat()),
    );
    put_damaged("spz", "v4-degree-0", &streams(3, 0));
    put_damaged("spz", "v4-degree-2", &streams(2, 2));
    put("spz", "v4-none", streams(0, 0));
    for target in ["scene", "summary"] {
        put(target, "spz-2", gzip(&content(2, 3, 1)));
        put(target, "spz-4", streams(3, 1));
    }
}

fn splat() {
    let row = |i: usize, scale: f32| {
        let mut row = Vec::new();
        for value in [i as f32, -1.5, 0.25, scale, 0.2, 0.0] {
            row.extend(value.to_le_bytes());
        }
        row.extend([i as u8 * 40, 200, 30, 255 - i as u8, 255, 128, 128, 128]);
        row
    };
    let rows = |scale| -> Vec<u8> { (0..3).flat_map(|i| row(i, scale)).collect() };
    put_damaged("splat", "rows", &rows(0.1));
    put("splat", "scale-nan", rows(f32::NAN));
    put("splat", "scale-negative", rows(-1.0));
    put("splat", "zeros", [0; 64]);
    put("splat", "text", "Dear diary, ".repeat(8));
    put("scene", "splat", rows(0.5));
    put("summary", "splat", rows(0.5));
}

/// A scene of three Gaussians in a file of a format.
fn converted(degree: usize, format: Format) -> Vec<u8> {
    let scene = |degree: usize| {
        let mut numbers = values(60, 3).cycle();
        let mut next = || numbers.next().unwrap_or_default();
        let mut sh = Sh {
            degree,
            coefficients: Vec::new(),
        };
        sh.coefficients = (0..3 * sh.per_gaussian()).map(|_| next()).collect();
        Gaussians {
            positions: (0..3).map(|_| [next(), next(), next()]).collect(),
            rotations: vec![[1.0, 0.0, 0.0, 0.0], [0.5; 4], [0.0, 1.0, 0.0, 0.0]],
            log_scales: (0..3).map(|_| [next(), next(), f32::NEG_INFINITY]).collect(),
            opacity_logits: vec![f32::INFINITY, next(), next()],
            sh,
        }
    };
    let mut bytes = Vec::new();
    convert(&scene(degree), format, Path::new("seed"), &mut bytes).expect("a small scene has a place");
    bytes
}

fn ksplat() {
    let target = "ksplat";
    put_damaged(target, "level-0-degree-0", &converted(0, Format::Ksplat));
    put_damaged(target, "level-0-degree-2", &converted(2, Format::Ksplat));
    // What the target puts behind headers: a level, a degree, and rows. Halves from 0.5 to 2.
    for (level, degree, row) in [(0, 1, 80), (1, 0, 24), (1, 2, 72), (2, 1, 33), (2, 2, 48)] {
        let mut rows = vec![level, degree];
        rows.extend((0..2 * row).map(|i| if i % 2 == 1 { 0x38 + i as u8 % 8 } else { i as u8 }));
        put(target, &format!("rows-level-{level}-degree-{degree}"), rows);
    }
    let mut two = converted(1, Format::Ksplat);
    (two[4], two[8]) = (2, 2);
    put(target, "section-missing", two);
    put("scene", "ksplat", converted(1, Format::Ksplat));
    put("summary", "ksplat", converted(1, Format::Ksplat));
}

fn gltf() {
    let file = converted;
    for (name, degree, format) in [
        ("glb-0", 0, Format::Glb),
        ("glb-3", 3, Format::Glb),
        ("text-1", 1, Format::Gltf),
    ] {
        put_damaged("gltf", name, &file(degree, format));
    }
    // JSON, a 0 and a buffer, under a node that turns, scales and shifts.
    let glb = file(1, Format::Glb);
    let (text, buffer) = glb.split_at(glb.windows(4).position(|w| w == b"BIN\0").unwrap_or_default());
    let text = String::from_utf8_lossy(&text[20..text.len() - 4])
        .trim_end()
        .to_string();
    let node = r#"{"children":[1],"rotation":[0.6,0,0,0.8],"scale":[2,2,2]},{"mesh":0,"translation":[1,2,3]}"#;
    let turned = text.replace(r#"{"mesh":0}"#, node);
    put_damaged("gltf", "turned", &[turned.as_bytes(), &[0], &buffer[4..]].concat());
    let stream = gzip(&content(3, 2, 1));
    let (length, own) = (stream.len(), "KHR_gaussian_splatting");
    let spz = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0,"rotation":[0,0.6,0,0.8]}}],"meshes":[{{"primitives":[{{"mode":0,"attributes":{{}},
"extensions":{{"{own}":{{"extensions":{{"{own}_compression_spz_2":{{"bufferView":0}}}}}}}}}}]}}],
"bufferViews":[{{"buffer":0,"byteLength":{length}}}],"buffers":[{{"byteLength":{length}}}]}}"#
    );
    put_damaged("gltf", "spz", &[spz.as_bytes(), &[0], &stream].concat());
    put("gltf", "no-asset", r#"{"position":[0,0,0]}"#);
    put("scene", "glb", file(1, Format::Glb));
    put("summary", "gltf", file(0, Format::Gltf));
}
