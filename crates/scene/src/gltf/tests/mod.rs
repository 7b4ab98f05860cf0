//! Tests of glTF, and the asset that they read: a mesh, two primitives of splats under nodes that turn, scale and shift
//! them, numbers of several kinds, and much that splats have nothing to do with.
mod companions;
mod garbage;
mod places;
mod refusals;
mod round_trips;
mod streams;

use crate::convert::tests::random;
use crate::summary::Summary;
use crate::{BadRows, Error, Format, Gaussians, Scene, Sh, summary};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::path::Path;

/// Splats of the first primitive and of the second.
const ROWS: [usize; 2] = [5, 3];
/// Bytes from one splat of the first primitive to the next: interleaved, and four that nobody knows.
const STRIDE: usize = 4 * (3 + 4 + 3 + 1 + 12 + 1);
/// Where the splats of both begin in the buffer, after a triangle.
const FIRST: usize = 36;
const SECOND: usize = FIRST + ROWS[0] * STRIDE;

/// What is in the buffer, in the spaces of the nodes: degree 1 and degree 3.
pub(super) fn splats() -> [Gaussians; 2] {
    let mut both = [random(ROWS[0], 1, 70), random(ROWS[1], 3, 71)];
    for rotation in both.iter_mut().flat_map(|one| &mut one.rotations) {
        let length = rotation.iter().map(|v| v * v).sum::<f32>().sqrt();
        *rotation = rotation.map(|v| v / length);
    }
    both
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn opacity(logit: f32) -> f32 {
    1.0 / (1.0 + (-logit).exp())
}

/// The buffer: a triangle; interleaved floats; blocks of integers and floats; five bytes that nobody refers to.
pub(super) fn buffer() -> Vec<u8> {
    let [first, second] = splats();
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    for row in 0..ROWS[0] {
        let [w, x, y, z] = first.rotations[row];
        bytes.extend(floats(&first.positions[row]));
        bytes.extend(floats(&[x, y, z, w]));
        bytes.extend(floats(&first.log_scales[row].map(f32::exp)));
        bytes.extend(floats(&[opacity(first.opacity_logits[row])]));
        bytes.extend(floats(&first.sh.coefficients[row * 12..(row + 1) * 12]));
        bytes.extend(b"kept");
    }
    assert_eq!(bytes.len(), SECOND);
    bytes.extend(floats(second.positions.as_flattened()));
    for [w, x, y, z] in &second.rotations {
        bytes.extend([x, y, z, w].map(|v| ((v * 127.0).round() as i8) as u8));
    }
    // Scales as normalised 16 bits, with two bytes to fill.
    for scales in &second.log_scales {
        let steps = scales.map(|log| (log.exp().min(1.0) * 65535.0) as u16);
        bytes.extend(steps.iter().flat_map(|step| step.to_le_bytes()));
        bytes.extend([0xaa, 0xbb]);
    }
    bytes.extend(
        second
            .opacity_logits
            .iter()
            .map(|logit| (opacity(*logit) * 255.0) as u8),
    );
    bytes.push(0xcc);
    for i in 0..16 {
        for row in 0..ROWS[1] {
            let at = row * 48 + 3 * i;
            bytes.extend(floats(&second.sh.coefficients[at..at + 3]));
        }
    }
    bytes.extend(b"five!");
    bytes
}

/// The first byte of coefficient `i` of splat `row` of a primitive.
pub(super) fn colour_at(primitive: usize, row: usize, i: usize) -> usize {
    match primitive {
        0 => FIRST + row * STRIDE + 44 + 12 * i,
        _ => SECOND + 36 + 12 + 24 + 4 + (3 * i + row) * 12,
    }
}

/// The JSON, written as nobody would; `uri` is that of the buffer.
pub(super) fn json(uri: Option<&str>) -> String {
    let (mut accessors, mut views) = (Vec::new(), Vec::new());
    let mut accessor = |view: usize, offset: usize, component: u32, normalized: bool, count: usize, kind: &str| {
        accessors.push(format!(
            r#"{{"bufferView":{view},"byteOffset":{offset},"componentType":{component},"normalized":{normalized},"count":{count},"type":"{kind}"}}"#
        ));
        accessors.len() - 1
    };
    views.push(r#"{ "buffer":0, "byteLength":36, "name":"triangle" }"#.to_string());
    let triangle = accessor(0, 0, 5126, false, 3, "VEC3");
    views.push(format!(
        r#"{{"buffer":0,"byteOffset":{FIRST},"byteLength":{},"byteStride":{STRIDE}}}"#,
        ROWS[0] * STRIDE
    ));
    let mut interleaved = vec![
        ("POSITION".to_string(), accessor(1, 0, 5126, false, ROWS[0], "VEC3")),
        ("ROTATION".to_string(), accessor(1, 12, 5126, false, ROWS[0], "VEC4")),
        ("SCALE".to_string(), accessor(1, 28, 5126, false, ROWS[0], "VEC3")),
        ("OPACITY".to_string(), accessor(1, 40, 5126, false, ROWS[0], "SCALAR")),
    ];
    for i in 0..4 {
        interleaved.push((harmonic(i), accessor(1, 44 + 12 * i, 5126, false, ROWS[0], "VEC3")));
    }
    views.push(format!(r#"{{"buffer":0,"byteOffset":{SECOND},"byteLength":36}}"#));
    views.push(format!(
        r#"{{"buffer":0,"byteOffset":{},"byteLength":12}}"#,
        SECOND + 36
    ));
    views.push(format!(
        r#"{{"buffer":0,"byteOffset":{},"byteLength":24,"byteStride":8}}"#,
        SECOND + 48
    ));
    views.push(format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":3}}"#, SECOND + 72));
    views.push(format!(
        r#"{{"byteLength":{},"buffer":0,"byteOffset":{}}}"#,
        16 * 36,
        SECOND + 76
    ));
    let mut blocks = vec![
        ("POSITION".to_string(), accessor(2, 0, 5126, false, ROWS[1], "VEC3")),
        ("ROTATION".to_string(), accessor(3, 0, 5120, true, ROWS[1], "VEC4")),
        ("SCALE".to_string(), accessor(4, 0, 5123, true, ROWS[1], "VEC3")),
        ("OPACITY".to_string(), accessor(5, 0, 5121, true, ROWS[1], "SCALAR")),
    ];
    for i in 0..16 {
        blocks.push((harmonic(i), accessor(6, 36 * i, 5126, false, ROWS[1], "VEC3")));
    }
    let attributes = |all: &[(String, usize)]| {
        let name = |name: &str| match name {
            "POSITION" => name.to_string(),
            _ => format!("KHR_gaussian_splatting:{name}"),
        };
        let all: Vec<String> = all.iter().map(|(n, index)| format!("{:?}: {index}", name(n))).collect();
        all.join(" ,")
    };
    let splatting = r#""extensions":{"KHR_gaussian_splatting":{"kernel":"ellipse","colorSpace":"srgb_rec709_display","extras":[1e2]}}"#;
    let uri = uri.map_or(String::new(), |uri| format!(r#","uri":{uri:?}"#));
    let length = buffer().len();
    format!(
        r#"{{
	"scenes" : [ {{"nodes":[3]}}, {{ "nodes":[ 0 ] , "extras": {{"scene":1}} }} ],"scene":1,
  "asset":{{"generator":"a test, with \"quotes\" and \\","version":"2.0"}},
  "extensionsUsed":["KHR_gaussian_splatting","EXT_unknown"],
  "nodes":[
    {{"name":"root","children":[1,2,3],"rotation":[0,0,0.7071067811865476,0.7071067811865476],"scale":[2,2,2]}},
    {{"mesh":0,"extras":{{"a\u0062c":[{{}},[]]}}}},
    {{"mesh":1,"matrix":[0.36,0.48,-0.8,0,-0.8,0.6,0,0,0.48,0.64,0.6,0,1,2,3,1]}},
    {{"camera":0,"translation":[0,0,5]}}
  ],
  "cameras":[{{"type":"perspective","perspective":{{"yfov":0.8,"znear":0.01}}}}],
  "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1.0,0.50,0.250,1]}}}}],
  "meshes":[
    {{"primitives":[{{"attributes":{{"POSITION":{triangle}}},"material":0}},{{"mode":0,"attributes":{{{}}},{splatting}}}],"name":"a mesh and splats"}},
    {{"primitives":[{{"attributes":{{{}}},{splatting},"mode":0}}]}}
  ],
  "accessors":[{}],
  "bufferViews":[{}],
  "buffers":[{{"byteLength":{length}{uri},"name":"all"}}]
}}
"#,
        attributes(&interleaved),
        attributes(&blocks),
        accessors.join(","),
        views.join(",\n"),
    )
}

fn harmonic(i: usize) -> String {
    let degree = i.isqrt();
    format!("SH_DEGREE_{degree}_COEF_{}", i - degree * degree)
}

/// A binary file of a JSON and a buffer, with a chunk that nobody knows and bytes behind it.
pub(super) fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let mut chunks = Vec::new();
    for (kind, data, fill) in [
        (&b"JSON"[..], json.as_bytes(), b' '),
        (b"BIN\0", buffer, 0),
        (b"XTRA", b"extr", 0),
    ] {
        let length = data.len().next_multiple_of(4);
        chunks.extend((length as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(data);
        chunks.extend(vec![fill; length - data.len()]);
    }
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((12 + chunks.len() as u32).to_le_bytes());
    file.extend(chunks);
    file.extend(b"behind");
    file
}

/// The asset as a binary file.
pub(super) fn asset() -> Vec<u8> {
    glb(&json(None), &buffer())
}

/// The asset as JSON with its buffer in it.
pub(super) fn text() -> Vec<u8> {
    let uri = format!("data:application/gltf-buffer;base64,{}", STANDARD.encode(buffer()));
    json(Some(&uri)).into_bytes()
}

/// Where the buffer begins in a binary file.
pub(super) fn buffer_start(file: &[u8]) -> usize {
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    12 + 8 + word(12) + 8
}

pub(super) fn read(bytes: &[u8]) -> Result<Scene, String> {
    read_with(bytes, BadRows::Refuse)
}

pub(super) fn read_with(bytes: &[u8], bad_rows: BadRows) -> Result<Scene, String> {
    match Scene::parse_with(Path::new("it"), bytes, bad_rows) {
        Ok(scene) => {
            // Garbage of whole rows is a scene of another format.
            if matches!(scene.format(), Format::Gltf | Format::Glb) {
                assert_eq!(
                    summary(Path::new("it"), bytes, bytes.len() as u64).unwrap(),
                    None::<Summary>
                );
            }
            Ok(scene)
        }
        Err(Error::BadScene { reason, .. }) => Err(reason),
        Err(other) => Err(other.to_string()),
    }
}

pub(super) fn written(scene: &Scene, sh: &Sh) -> Vec<u8> {
    let mut bytes = Vec::new();
    scene.encode(sh, &mut bytes).unwrap();
    bytes
}

/// Other colours, as an embedding would have them.
pub(super) fn changed(scene: &Scene) -> Sh {
    let mut sh = scene.gaussians.sh.clone();
    for (i, value) in sh.coefficients.iter_mut().enumerate() {
        *value += [0.03, -0.05, 0.02, 0.0, -0.01][i % 5];
    }
    sh
}

/// Colours as a file keeps them.
pub(super) fn kept(scene: &Scene, sh: &Sh) -> Sh {
    let mut kept = sh.clone();
    for (row, colour) in kept.coefficients.chunks_exact_mut(sh.per_gaussian()).enumerate() {
        scene.quantize_colors(row, colour);
    }
    kept
}
