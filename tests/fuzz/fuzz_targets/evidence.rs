//! Fuzzes `guardsplat_fuzz::evidence`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::evidence(data));
