//! Fuzzes `guardsplat_fuzz::compressed_ply`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::compressed_ply(data));
