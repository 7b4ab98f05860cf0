//! Fuzzes `guardsplat_fuzz::requests`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::requests(data));
