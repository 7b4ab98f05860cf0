//! Fuzzes `guardsplat_fuzz::message`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::message(data));
