//! Fuzzes `guardsplat_fuzz::splat`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::splat(data));
