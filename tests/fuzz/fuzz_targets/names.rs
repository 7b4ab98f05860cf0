//! Fuzzes `guardsplat_fuzz::names`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::names(data));
