//! Fuzzes `guardsplat_fuzz::lpips_package`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::lpips_package(data));
