//! Fuzzes `guardsplat_fuzz::clip_weights`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::clip_weights(data));
