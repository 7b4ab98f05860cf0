//! Fuzzes `guardsplat_fuzz::sog_meta`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::sog_meta(data));
