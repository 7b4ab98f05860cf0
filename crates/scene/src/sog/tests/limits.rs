//! Small files that ask for much memory get none.
use super::round_trips::find;
use super::*;
use crate::BadRows;

/// A lossless picture of one colour, which takes next to no bytes.
fn flat(width: u32, height: u32, texel: [u8; 4]) -> Vec<u8> {
    let mut bits: Vec<(u32, u32)> = vec![(0x2f, 8), (width - 1, 14), (height - 1, 14), (1, 1), (0, 3)];
    bits.extend([(0, 1), (0, 1), (0, 1)]); // no transform, no colour cache, one set of codes
    for symbol in [texel[1], texel[0], texel[2], texel[3], 0] {
        bits.extend([(1, 1), (0, 1), (1, 1), (u32::from(symbol), 8)]); // a code of one symbol has no bits
    }
    let mut data = Vec::new();
    let (mut byte, mut filled) = (0u8, 0);
    for (value, count) in bits {
        for i in 0..count {
            byte |= ((value >> i & 1) as u8) << filled;
            filled += 1;
            if filled == 8 {
                data.push(std::mem::take(&mut byte));
                filled = 0;
            }
        }
    }
    data.push(byte);
    data.resize(data.len().next_multiple_of(2), 0);
    let size = data.len() as u32;
    [
        b"RIFF",
        &(size + 12).to_le_bytes()[..],
        b"WEBPVP8L",
        &size.to_le_bytes(),
        &data,
    ]
    .concat()
}

/// A file of `count` equal Gaussians.
fn equal(width: u32, height: u32, count: u64) -> Vec<u8> {
    let meta = File::new(2, 1, 5).with("/count", count.into()).meta;
    let mut entries: Vec<(String, Vec<u8>)> = ["means_l", "means_u", "scales", "quats", "sh0", "shN_labels"]
        .into_iter()
        .map(|name| (name.to_string(), flat(width, height, [1, 2, 3, 252])))
        .collect();
    entries[5].1 = flat(width, height, [1, 0, 0, 252]);
    entries.push(("shN_centroids".to_string(), flat(192, 2, [1, 2, 3, 4])));
    entries.push(("meta.json".to_string(), meta.to_string().into_bytes()));
    zip(&entries, CompressionMethod::Stored)
}

#[test]
fn small_files_of_equal_gaussians_are_read() {
    let scene = read(&equal(100, 50, 5000)).unwrap();
    assert_eq!((scene.gaussians.len(), scene.gaussians.sh.degree), (5000, 1));
    let sh = changed(&scene, |i, value| value + i as f32 * 1e-4);
    assert_eq!(read(&written(&scene, &sh)).unwrap().gaussians.sh, sh);
}

/// A hundred bytes can be a picture of a gigabyte.
#[test]
fn pictures_of_nothing_are_refused() {
    let file = equal(16000, 16000, 256_000_000);
    assert!(file.len() < 30_000);
    let reason = refused(&file);
    let limit = 64 * file.len() + (1 << 20);
    let words = format!("picture shN_labels: more than {limit} bytes unpacked, the limit for a file of this size");
    assert_eq!(reason, words);
    // With few Gaussians in them all the same.
    let reason = refused(&equal(16000, 16000, 5));
    assert!(reason.starts_with("picture shN_labels: more than "), "{reason}");
    // Pictures that would be allowed, of numbers that would not.
    let reason = refused(&equal(200, 200, 40_000));
    assert!(reason.starts_with("more than "), "{reason}");
}

#[test]
fn entries_that_inflate_without_end_are_refused() {
    let mut file = File::new(2, 0, 5);
    file.method = CompressionMethod::Deflated;
    file.meta["padding"] = " ".repeat(2 << 20).into();
    let bytes = file.bytes();
    let reason = refused(&bytes);
    assert!(
        reason.starts_with("meta.json has 2") && reason.ends_with("bytes, limit 1048576"),
        "{reason}"
    );
    // The same with a lie about it: not more than was said is unpacked.
    let mut lying = bytes;
    for (signature, at) in [(b"PK\x01\x02", 24), (b"PK\x03\x04", 22)] {
        let start = find(&lying, signature, "meta.json") + at;
        lying[start..start + 4].copy_from_slice(&100u32.to_le_bytes());
    }
    let reason = refused(&lying);
    assert!(reason.starts_with("meta.json cannot be unpacked"), "{reason}");
    // A picture with gigabytes of nothing after it.
    let mut entries = File::new(2, 0, 5).entries();
    entries[0].1.resize(64 << 20, 0);
    let reason = refused(&zip(&entries, CompressionMethod::Deflated));
    assert!(reason.starts_with("means_l: more than "), "{reason}");
}

/// Written again, entries that share their bytes would be a file many times as large.
#[test]
fn entries_that_overlap_are_refused() {
    let mut file = File::new(2, 0, 5);
    file.others = vec![("a".to_string(), vec![1; 60_000]), ("b".to_string(), vec![2; 60_000])];
    let mut bytes = file.bytes();
    let start = find(&bytes, b"PK\x03\x04", "a") as u32;
    let central = find(&bytes, b"PK\x01\x02", "b");
    // The second starts where the first does, and the first goes on to the end of the second.
    bytes[central + 42..central + 46].copy_from_slice(&start.to_le_bytes());
    let central = find(&bytes, b"PK\x01\x02", "a");
    bytes[central + 20..central + 24].copy_from_slice(&120_000u32.to_le_bytes());
    let reason = refused(&bytes);
    assert!(reason.starts_with("a broken ZIP: entries of "), "{reason}");
}

/// 64 bits for the number of entries are 64 bits for what is allocated for them.
#[test]
fn zip64_is_refused() {
    let mut bytes = File::new(2, 0, 5).bytes();
    let end = bytes.len() - 22;
    let mut locator = b"PK\x06\x07".to_vec();
    locator.resize(20, 0);
    bytes.splice(end..end, locator);
    assert_eq!(refused(&bytes), "a ZIP64; a SOG is a ZIP without that extension");
}

/// What a job may take is no more than its machine has for it, whatever a file of that size may ask for.
#[test]
fn no_more_memory_is_taken_than_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("equal.sog");
    let bytes = equal(100, 50, 5000);
    std::fs::write(&path, &bytes).unwrap();
    let within = |memory| Scene::read_within(&path, BadRows::Refuse, memory);
    let size = bytes.len() as u64;
    // Five pictures of the Gaussians, the palette's two, and 23 numbers a Gaussian of one band.
    let enough = size + (1 << 20);
    assert_eq!(within(enough).unwrap().gaussians.len(), 5000);
    // Of the file itself, of its pictures, and of its numbers.
    for memory in [0, size - 1, size, size + 20_000, size + 300_000] {
        match within(memory) {
            Err(Error::DoesNotFit { memory: told, .. }) => assert_eq!(told, memory),
            other => panic!("{memory}: {:?}", other.map(|scene| scene.gaussians.len())),
        }
    }
    // What no machine would be allowed to unpack is the file's fault.
    std::fs::write(&path, equal(16000, 16000, 256_000_000)).unwrap();
    assert!(matches!(within(8 << 30), Err(Error::BadScene { .. })));
}
