//! Fuzzes `guardsplat_fuzz::server_settings`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::server_settings(data));
