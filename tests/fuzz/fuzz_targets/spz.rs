//! Fuzzes `guardsplat_fuzz::spz`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::spz(data));
