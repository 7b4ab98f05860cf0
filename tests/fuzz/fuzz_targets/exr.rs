//! Fuzzes `guardsplat_fuzz::exr`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::exr(data));
