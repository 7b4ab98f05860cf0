//! Fuzzes `guardsplat_fuzz::embed_settings`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::embed_settings(data));
