//! Fuzzes `guardsplat_fuzz::soft_binding`.
#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| guardsplat_fuzz::soft_binding(data));
