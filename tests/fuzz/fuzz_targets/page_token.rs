//! Fuzzes `guardsplat_fuzz::page_token`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::page_token(data));
