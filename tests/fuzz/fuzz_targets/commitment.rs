//! Fuzzes `guardsplat_fuzz::commitment`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::commitment(data));
