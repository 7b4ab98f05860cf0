//! Every kind of bad file has its message.
use super::*;

fn contains(reason: &str, parts: &[&str]) {
    assert!(
        parts.iter().all(|part| reason.contains(part)),
        "{reason:?} lacks some of {parts:?}"
    );
}

#[test]
fn other_versions_are_named() {
    for version in [0, 1, 5, u32::MAX] {
        let mut file = File::new(3, 0, 1);
        file.version = version;
        contains(
            &file.refused(),
            &[
                &format!("version {version} in a gzip stream"),
                "versions 2 and 3",
                "version 4",
            ],
        );
        let mut bytes = File::new(4, 0, 1).bytes();
        bytes[4..8].copy_from_slice(&version.to_le_bytes());
        contains(
            &refused(&bytes),
            &[&format!("version {version}"), "versions 2 and 3", "version 4"],
        );
    }
    // Each in the container of the other.
    let mut bytes = File::new(4, 0, 1).bytes();
    bytes[4] = 3;
    contains(&refused(&bytes), &["version 3 in a file without gzip"]);
    let mut content = File::new(3, 0, 1).content();
    content[4] = 4;
    contains(&refused(&gzip(&content)), &["version 4 in a gzip stream"]);
}

#[test]
fn fields_of_the_header_have_limits() {
    for version in VERSIONS {
        let mut file = File::new(version, 4, 1);
        file.degree = 5;
        contains(&file.refused(), &["degree 5", "4"]);
        let mut file = File::new(version, 0, 1);
        file.fractional_bits = 25;
        contains(&file.refused(), &["25 fractional bits", "24"]);
    }
    let mut file = File::new(2, 0, 1);
    file.magic = *b"ply\n";
    contains(&file.refused(), &["not an SPZ scene", "ply\\n", "NGSP"]);
    contains(&refused(&gzip(b"")), &["not an SPZ scene", "0 bytes"]);
    contains(
        &refused(&gzip(b"ply\nformat ascii 1.0\nelement")),
        &["a gzip stream that begins with \"ply\\n\""],
    );
}

#[test]
fn every_truncation_is_refused() {
    for version in VERSIONS {
        let mut file = File::new(version, 1, 2);
        file.extensions = vec![1, 2, 3];
        let bytes = file.bytes();
        read(&bytes).unwrap();
        for length in 2..bytes.len() {
            if version != 4 || length >= 4 {
                let reason = refused(&bytes[..length]);
                assert!(
                    reason.contains("truncated") || reason.contains("table of contents"),
                    "{length}: {reason}"
                );
            }
        }
        // Whole streams of less.
        let content = File::new(version, 1, 2).content();
        for length in 0..content.len() {
            if version != 4 {
                let reason = refused(&gzip(&content[..length]));
                assert!(
                    reason.contains("truncated") || reason.contains("fewer than a header"),
                    "{length}: {reason}"
                );
            }
        }
    }
    let mut file = File::new(2, 0, 10);
    file.sections[4].pop();
    contains(&file.refused(), &["10 Gaussians", "190 bytes", "189 are there"]);
}

#[test]
fn counts_that_lie_cost_nothing() {
    for version in VERSIONS {
        for points in [60_000, 4_000_000, u32::MAX] {
            let mut file = File::new(version, 3, 2);
            file.points = points;
            contains(&file.refused(), &["promises Gaussians of", "may hold 10"]);
        }
        let mut file = File::new(version, 0, 3);
        file.points = 4;
        let reason = file.refused();
        contains(
            &reason,
            if version == 4 {
                &["positions has 27", "must have 36"]
            } else {
                &["truncated", "4 Gaussians"]
            },
        );
    }
}

#[test]
fn bombs_of_gzip_are_not_filled() {
    // 300 MB of zeros, of which a Gaussian takes 20 bytes.
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    let mut content = File::new(3, 0, 1).content();
    encoder.write_all(&content).unwrap();
    (0..300).for_each(|_| encoder.write_all(&[0; 1_000_000]).unwrap());
    contains(
        &refused(&encoder.finish().unwrap()),
        &["more than 16777216 bytes follow"],
    );
    // As many Gaussians of zeros as 20 MB hold: a ratio of 1,000.
    content[8..12].copy_from_slice(&1_000_000u32.to_le_bytes());
    content.resize(16 + 20_000_000, 0);
    contains(&refused(&gzip(&content)), &["promises Gaussians of 20000000 bytes"]);
    // And as few as pass.
    let ok = 50_000u32;
    content[8..12].copy_from_slice(&ok.to_le_bytes());
    content.truncate(16 + 20 * ok as usize);
    assert_eq!(read(&gzip(&content)).unwrap().gaussians.len(), ok as usize);
}

#[test]
fn bombs_of_zstd_are_not_filled() {
    let file = File::new(4, 1, 2);
    let compress = |section: &[u8]| zstd::bulk::compress(section, 1).unwrap();
    for i in 0..6 {
        for content in [&[0u8; 100_000_000][..], &[0; 3], &[]] {
            let bytes = file.streams(
                |j, section| if i == j { compress(content) } else { compress(section) },
                |_| (),
            );
            let name = ["positions", "alphas", "colours", "scales", "rotations", "harmonics"][i];
            let short = i != 1 || content.len() != 3;
            contains(
                &refused(&bytes),
                &["the stream of", if short { name } else { "alphas" }],
            );
        }
    }
    // Many Gaussians that are all alike, with a table of contents that says so.
    let mut many = File::new(4, 3, 1_000_000);
    many.sections = many.sections.map(|section| vec![0; section.len()]);
    contains(&many.refused(), &["promises Gaussians of 65000000 bytes"]);
}

#[test]
fn tables_of_contents_are_checked() {
    let file = File::new(4, 1, 2);
    let compress = |_: usize, section: &[u8]| zstd::bulk::compress(section, 1).unwrap();
    let names = ["positions", "alphas", "colours", "scales", "rotations", "harmonics"];
    for (i, name) in names.into_iter().enumerate() {
        for lie in [0, 1, u64::MAX, u64::MAX / 2] {
            contains(
                &refused(&file.streams(compress, |toc| toc[i][1] = lie)),
                &[name, "must have"],
            );
        }
        for lie in [u64::MAX, 1 << 40, 1000] {
            contains(
                &refused(&file.streams(compress, |toc| toc[i][0] = lie)),
                &[name, "truncated"],
            );
        }
        for lie in [0, 1] {
            contains(&refused(&file.streams(compress, |toc| toc[i][0] = lie)), &[name]);
        }
    }
    for streams in [0, 5, 7, 255] {
        let mut bytes = file.bytes();
        bytes[15] = streams;
        contains(&refused(&bytes), &[&format!("{streams} streams"), "has 6"]);
    }
    for toc in [0, 31, 10_000, u32::MAX, u32::MAX - 90] {
        let mut bytes = file.bytes();
        bytes[16..20].copy_from_slice(&toc.to_le_bytes());
        contains(&refused(&bytes), &["table of contents", &toc.to_string()]);
    }
}

#[test]
fn damaged_streams_are_named() {
    // The last bytes of a gzip stream are its checksum and its length.
    for from_end in 1..=8 {
        let mut bytes = File::new(2, 0, 3).bytes();
        let place = bytes.len() - from_end;
        bytes[place] ^= 1;
        contains(&refused(&bytes), &["damaged gzip stream"]);
    }
    let file = File::new(4, 0, 2);
    let bytes = file.streams(
        |i, section| {
            let mut stream = zstd::bulk::compress(section, 1).unwrap();
            stream[0] ^= u8::from(i == 3);
            stream
        },
        |_| (),
    );
    contains(&refused(&bytes), &["the stream of scales is damaged"]);
}
