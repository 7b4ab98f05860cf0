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
    let folder = tempfile::tempdir().unwrap();
    for (what, file) in files {
        let path = folder.path().join("it");
        std::fs::write(&path, &file).unwrap();
        for bad_rows in [BadRows::Refuse, BadRows::Ignore] {
            ALLOCATOR.reset_peak_memory();
            assert!(Scene::read_with(&path, bad_rows).is_err(), "{what}");
            assert!(summary(Path::new("it"), &file[..file.len().min(HEAD)], file.len() as u64).is_err());
            let peak = ALLOCATOR.get_peak_memory();
            assert!(peak < ENOUGH, "{what}: {peak} bytes");
        }
    }
}
