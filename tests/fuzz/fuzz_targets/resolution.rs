//! Fuzzes `guardsplat_fuzz::resolution`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::resolution(data));
