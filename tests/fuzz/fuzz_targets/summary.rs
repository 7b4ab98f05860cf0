//! Fuzzes `guardsplat_fuzz::summary`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::summary(data));
