//! Fuzzes `guardsplat_fuzz::scene`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::scene(data));
