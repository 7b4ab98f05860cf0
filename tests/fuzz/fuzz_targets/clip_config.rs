//! Fuzzes `guardsplat_fuzz::clip_config`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::clip_config(data));
