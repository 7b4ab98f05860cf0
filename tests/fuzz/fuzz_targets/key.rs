//! Fuzzes `guardsplat_fuzz::key`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::key(data));
