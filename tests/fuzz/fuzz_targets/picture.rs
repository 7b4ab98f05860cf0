//! Fuzzes `guardsplat_fuzz::picture`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::picture(data));
