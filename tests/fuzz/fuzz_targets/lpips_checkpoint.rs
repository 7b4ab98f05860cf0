//! Fuzzes `guardsplat_fuzz::lpips_checkpoint`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::lpips_checkpoint(data));
