//! The package that weights of LPIPS come in, and the pickle in it.
use crate::memory::bounded;
use burn::tensor::Device;
use flate2::Compression;
use flate2::write::GzEncoder;
use guardsplat_engine::models::lpips::{checkpoint, convert};
use guardsplat_engine::quality::Lpips;
use std::io::Write as _;

/// Most bytes of numbers that are made up: the checkpoint has 9.9 MB.
const MOST: usize = 12 << 20;
/// Fewest bytes that are taken for the numbers of an array.
const ARRAY: usize = 64;

/// Checkpoints. What an input announces of long bytes is put in as zeros, so that arrays need no numbers in it.
pub fn lpips_checkpoint(data: &[u8]) {
    for file in [data.to_vec(), with_numbers(data)] {
        if let Ok(weights) = bounded(file.len(), || convert(&file)) {
            assert!(Lpips::from_bytes(&weights, &Device::flex()).is_ok());
        }
    }
}

/// Packages; also given without gzip around them, through whose checksum no change would get.
pub fn lpips_package(data: &[u8]) {
    let mut gzip = GzEncoder::new(Vec::new(), Compression::fast());
    let packed = gzip.write_all(data).and_then(|()| gzip.finish());
    for package in [data, &packed.expect("memory can be written to")] {
        if let Ok(bytes) = bounded(package.len(), || checkpoint(package)) {
            let _ = bounded(bytes.len(), || convert(&bytes));
        }
    }
}

/// The pickle with zeros after every `BINBYTES` of some length.
fn with_numbers(data: &[u8]) -> Vec<u8> {
    let (mut file, mut rest) = (Vec::new(), data);
    while let Some(at) = rest.iter().position(|byte| *byte == b'B') {
        let (before, announced) = rest.split_at(at + 1);
        file.extend_from_slice(before);
        rest = announced;
        let Some((length, after)) = announced.split_first_chunk() else {
            break;
        };
        let size = u32::from_le_bytes(*length) as usize;
        if size >= ARRAY && file.len() + size <= MOST {
            file.extend_from_slice(length);
            file.resize(file.len() + size, 0);
            rest = after;
        }
    }
    file.extend_from_slice(rest);
    file
}
