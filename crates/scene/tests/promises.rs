//! Headers that promise more than there is are refused in constant memory: what is asked of the allocator is counted.
use guardsplat_scene::{BadRows, HEAD, Scene, summary};
use peakmem_alloc::{INSTRUMENTED_SYSTEM, PeakMemAlloc, PeakMemAllocTrait};
use std::alloc::System;
use std::path::Path;

#[global_allocator]
static ALLOCATOR: &PeakMemAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Bytes that a refusal may ask for at once: a header, what was understood of it, and a message.
const ENOUGH: usize = 256 << 10;

/// What the names of the properties of a scene of degree 0 are.
const NAMES: &str = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";

fn ply(format: &str, elements: &str, names: &str) -> Vec<u8> {
    let properties: String = names
        .split_whitespace()
        .map(|name| format!("property float {name}\n"))
        .collect();
    let mut file = format!("ply\nformat {format} 1.0\n{elements}\n{properties}end_header\n").into_bytes();
    file.extend([b'1'; 560]);
    file
}

/// The header of an SPZ of version 4 with so many Gaussians.
fn spz(points: u32) -> Vec<u8> {
    let mut file = [&b"NGSP"[..], &4u32.to_le_bytes(), &points.to_le_bytes(), &[3, 12, 0, 6]].concat();
    file.resize(600, 0);
    file
}

/// A binary glTF of a little JSON and a small buffer.
fn glb(json: &str) -> Vec<u8> {
    let json = json.to_string() + &" ".repeat(json.len().next_multiple_of(4) - json.len());
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((12 + 8 + json.len() as u32 + 8 + 64).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json.as_bytes());
    file.extend(64u32.to_le_bytes());
    file.extend(b"BIN\0");
    let mut spz = spz(400_000_000);
    spz.truncate(64);
    file.extend(spz);
    file
}

/// Primitives of splats that promise much: of as many as `count`, in the buffer, and as an SPZ.
fn gltf(count: u64, length: u64) -> [Vec<u8>; 2] {
    let own = "KHR_gaussian_splatting";
    let start = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"mode":0,"attributes":{"#;
    let end = format!(
        r#""accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3"}}],
"bufferViews":[{{"buffer":0,"byteLength":{length}}}],"buffers":[{{"byteLength":{length}}}]}}"#
    );
    [
        glb(&format!(
            r#"{start}"POSITION":0,"{own}:ROTATION":0,"{own}:SCALE":0,"{own}:OPACITY":0,"{own}:SH_DEGREE_0_COEF_0":0}},"extensions":{{"{own}":{{}}}}}}]}}],{end}"#
        )),
        glb(&format!(
            r#"{start}}},"extensions":{{"{own}":{{"extensions":{{"{own}_compression_spz":{{"bufferView":0}}}}}}}}}}]}}],{end}"#
        )),
    ]
}

// One test: another thread's memory would be counted too.
#[test]
fn headers_that_promise_too_much_cost_nothing() {
    let mut files = vec![("400 million points of an SPZ".to_string(), spz(400_000_000))];
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for (elements, names) in [
            ("element vertex 100000000000000000000000", NAMES),
            ("element vertex 18446744073709551615", NAMES),
            ("element vertex 400000000", NAMES),
            ("element vertex 400000000", ""),
            ("element nothing 400000000\nelement vertex 10", NAMES),
            ("element vertex 400000000", "packed_position"),
        ] {
            files.push((format!("{elements}, {format}, {names}"), ply(format, elements, names)));
        }
    }
    for (count, length) in [(400_000_000, 64), (u64::MAX, 64), (400_000_000, 1 << 40), (5, 64)] {
        files.extend(gltf(count, length).map(|file| (format!("{count} splats of {length} bytes"), file)));
    }
    let folder = tempfile::tempdir().unwrap();
    for (what, file) in files {
        let path = folder.path().join("it");
        std::fs::write(&path, &file).unwrap();
        for bad_rows in [BadRows::Refuse, BadRows::Ignore] {
            ALLOCATOR.reset_peak_memory();
            assert!(Scene::read_with(&path, bad_rows).is_err(), "{what}");
            let said = summary(Path::new("it"), &file[..file.len().min(HEAD)], file.len() as u64);
            assert!(matches!(said, Err(_) | Ok(None)));
            let peak = ALLOCATOR.get_peak_memory();
            assert!(peak < ENOUGH, "{what}: {peak} bytes");
        }
    }
}
