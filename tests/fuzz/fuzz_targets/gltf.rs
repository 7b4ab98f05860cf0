//! Fuzzes `guardsplat_fuzz::gltf`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::gltf(data));
