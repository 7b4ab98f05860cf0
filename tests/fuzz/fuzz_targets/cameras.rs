//! Fuzzes `guardsplat_fuzz::cameras`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::cameras(data));
