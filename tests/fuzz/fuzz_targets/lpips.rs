//! Fuzzes `guardsplat_fuzz::lpips`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::lpips(data));
