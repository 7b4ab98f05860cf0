//! Fuzzes `guardsplat_fuzz::ksplat`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::ksplat(data));
