//! Fuzzes `guardsplat_fuzz::sealed`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::sealed(data));
