//! Every kind of bad file has its message.
use super::round_trips::find;
use super::*;

fn says(file: &File, words: &str) {
    let reason = file.refused();
    assert!(reason.contains(words), "{reason}");
}

#[test]
fn what_is_missing_is_named() {
    let file = || File::new(2, 1, 5);
    for name in [
        "means_l",
        "means_u",
        "scales",
        "quats",
        "sh0",
        "shN_centroids",
        "shN_labels",
    ] {
        let mut file = file();
        file.pictures.retain(|(other, ..)| *other != name);
        says(&file, &format!("the ZIP has no {name}"));
    }
    for name in ["means", "scales", "quats", "sh0"] {
        says(&file().without(&format!("/{name}")), &format!("missing field `{name}`"));
        says(&file().without(&format!("/{name}/files")), "missing field `files`");
        let files = if name == "means" { 2 } else { 1 };
        says(
            &file().with(&format!("/{name}/files"), json!([])),
            &format!("{name}.files has 0 names, must have {files}"),
        );
    }
    says(&file().without("/count"), "meta.json: no count");
    says(&File::new(1, 0, 5).without("/means/shape"), "meta.json: no means.shape");
    says(&file().without("/means/maxs"), "means.maxs has no number 0");
    says(&file().with("/means/mins", json!([1, 2])), "means.mins has no number 2");
    says(
        &File::new(1, 0, 5).with("/sh0/maxs", json!([1, 2, 3])),
        "sh0.maxs has no number 3",
    );
    for name in ["scales", "sh0", "shN"] {
        says(
            &file().without(&format!("/{name}/codebook")),
            &format!("no {name}.codebook"),
        );
    }
    let entries = [("scene.ply".to_string(), b"ply".to_vec())];
    let reason = refused(&zip(&entries, CompressionMethod::Stored));
    assert_eq!(reason, "not an SOG, or not all of it: the ZIP has no meta.json");
}

#[test]
fn what_is_wrong_is_named() {
    let file = || File::new(2, 1, 5);
    says(&file().with("/version", 3.into()), "version 3; known are 1 and 2");
    says(&file().with("/count", json!(-1)), "meta.json: invalid value");
    says(
        &file().with("/count", json!(9)),
        "picture shN_labels: 4 x 2 pixels are too few for 9 Gaussians",
    );
    says(
        &file().with("/count", json!(u64::MAX)),
        "too few for 18446744073709551615 Gaussians",
    );
    says(&file().with("/sh0/files", json!(["scales"])), "one file for two things");
    says(
        &file().with("/sh0/files", json!(["meta.json"])),
        "one file for two things",
    );
    says(
        &file().with("/quats/encoding", "other".into()),
        "quats.encoding is not quaternion_packed",
    );
    says(
        &file().with("/means/maxs/1", json!(88.5)),
        "means.mins and means.maxs 1 are -2e0 and 8.85e1, limit 88",
    );
    says(&file().with("/sh0/codebook", json!([[1]])), "meta.json: invalid type");
    says(&file().with("/sh0/codebook", json!([])), "sh0.codebook: no numbers");
    says(
        &file().with("/sh0/codebook/3", json!(1e39)),
        "sh0.codebook: number 3 is too large",
    );
    says(
        &File::new(1, 0, 5).with("/scales/maxs/2", json!(1e39)),
        "scales.mins and scales.maxs: -7e0 to 1e39 are too large",
    );
    says(&file().with("/shN/bands", 4.into()), "shN.bands must be 1, 2 or 3");
    says(
        &file().with("/shN/count", 65537.into()),
        "shN.count must be at most 65536",
    );
    says(
        &file().with("/shN/bands", 2.into()),
        "192 pixels wide, of 1 bands, and shN.bands is 2",
    );
    says(
        &file().with("/shN/count", 129.into()),
        "room for 128 rows, and shN.count is 129",
    );
    says(
        &file().pixel("shN_labels", 3, [70, 0, 0, 0]),
        "row 3 of shN_labels is 70, and the palette has 70 rows",
    );
    says(
        &file().pixel("shN_labels", 3, [0, 1, 0, 0]),
        "row 3 of shN_labels is 256",
    );
    says(
        &file().pixel("quats", 4, [0, 0, 0, 251]),
        "row 4 of quats has an alpha of 251, must be 252 to 255",
    );
    // Beyond the Gaussians pixels may be anything.
    file().pixel("quats", 5, [0; 4]).read().unwrap();
    file().pixel("shN_labels", 5, [255; 4]).read().unwrap();
    for name in ["scales", "sh0"] {
        let file = file()
            .with(&format!("/{name}/codebook/8"), Value::Null)
            .pixel(name, 2, [1, 8, 2, 0]);
        let words = format!("row 2 of {name} has index 8, which {name}.codebook has no number for");
        says(&file.clone().pixel(name, 1, [9; 4]).pixel(name, 0, [9; 4]), &words);
    }
    let mut narrow = file();
    narrow.pictures[5].1 = 191;
    narrow.pictures[5].2.truncate(191 * 2);
    says(&narrow, "191 pixels wide, must be 192, 512 or 960");
    let mut turned = file();
    turned.pictures[2].1 = 2;
    says(&turned, "picture scales: 2 x 4 pixels, others 4 x 2");
}

#[test]
fn messages_are_short_whatever_the_file_says() {
    let file = File::new(2, 0, 5).with("/count", "long ".repeat(10_000).into());
    assert!(file.refused().chars().count() < 300);
    let file = File::new(2, 0, 5).with("/sh0/files", json!(["long ".repeat(10_000)]));
    assert_eq!(file.refused(), "not an SOG, or not all of it: the ZIP has no sh0");
}

#[test]
fn pictures_that_are_none_are_named() {
    let file = File::new(2, 0, 5);
    let mut entries = file.entries();
    let at = entries.iter().position(|(name, _)| name == "scales").unwrap();
    entries[at].1.truncate(30);
    let reason = refused(&zip(&entries, CompressionMethod::Stored));
    assert!(reason.starts_with("picture scales: not a readable WebP"), "{reason}");
    entries[at].1 = b"\x89PNG\r\n\x1a\n".to_vec();
    let reason = refused(&zip(&entries, CompressionMethod::Stored));
    assert!(reason.starts_with("picture scales: not a readable WebP"), "{reason}");
}

/// A folder's index comes without its pictures.
#[test]
fn folders_are_refused_by_their_meta_json() {
    let mut file = File::new(2, 1, 5);
    let reason = "the meta.json of an SOG without its pictures; give its folder, or bundle it into one .sog file";
    let text = file.meta.to_string();
    assert_eq!(refused(text.as_bytes()), reason);
    assert_eq!(
        refused(serde_json::to_string_pretty(&file.meta).unwrap().as_bytes()),
        reason
    );
    assert_eq!(
        refused(br#" {"version": 1, "lodLevels": 3, "filenames": ["0_0/meta.json"]}"#),
        "the lod-meta.json of a streamed SOG without its files; only the worker's commands take it, or its folder"
    );
    // In front of all else in the archive it may have a mark of byte order.
    let mut entries = file.entries();
    entries.last_mut().unwrap().1.splice(0..0, *b"\xef\xbb\xbf");
    read(&zip(&entries, CompressionMethod::Deflated)).unwrap();
    file.meta["version"] = json!("2");
    says(&file, "meta.json: invalid type: string");
}

#[test]
fn broken_archives_are_refused() {
    let bytes = File::new(2, 1, 5).bytes();
    for end in 4..bytes.len() {
        let reason = refused(&bytes[..end]);
        assert!(reason.starts_with("a broken ZIP"), "{end}: {reason}");
    }
    let damaged = |signature: &[u8], name: &str, at: usize, value: u32| {
        let mut bytes = bytes.clone();
        let start = find(&bytes, signature, name) + at;
        bytes[start..start + 4].copy_from_slice(&value.to_le_bytes());
        refused(&bytes)
    };
    let central = |name: &str, at: usize, value: u32| damaged(b"PK\x01\x02", name, at, value);
    // Checksum, then sizes packed and unpacked, then method.
    assert!(central("sh0", 16, 1).contains("sh0 cannot be unpacked"));
    assert!(central("sh0", 20, 1 << 30).contains("ends after the file"));
    let reason = central("meta.json", 24, 7);
    assert!(
        reason.starts_with("meta.json has not the 7 bytes") || reason.contains("cannot be unpacked"),
        "{reason}"
    );
    assert!(
        central("quats", 10, 0x0000_000e).contains("quats cannot be unpacked"),
        "LZMA"
    );
    assert_eq!(central("quats", 8, 0x0000_0001), "a ZIP whose entry 3 is encrypted");
    // A picture whose bytes are not what they were.
    let mut bytes = bytes.clone();
    let start = find(&bytes, b"PK\x03\x04", "means_u") + 30 + 7 + 30;
    bytes[start] ^= 4;
    let reason = refused(&bytes);
    assert!(reason.starts_with("means_u cannot be unpacked"), "{reason}");
}

/// Two entries of a name are one for one reader and the other for another.
#[test]
fn ambiguous_archives_are_refused() {
    let mut file = File::new(2, 0, 5);
    file.others = vec![("sh1".to_string(), b"other".to_vec())];
    let mut bytes = file.bytes();
    for signature in [b"PK\x03\x04", b"PK\x01\x02"] {
        let start = find(&bytes, signature, "sh1") + if signature[2] == 1 { 46 } else { 30 };
        bytes[start + 2] = b'0';
    }
    assert_eq!(refused(&bytes), "a ZIP with two entries of one name");
}

/// What is none of ours but cannot be copied would be missed when the scene is written.
#[test]
fn archives_that_cannot_be_written_again_are_refused() {
    // An empty entry whose name is as long as names can be, which our writer has no room for.
    let header = |signature: &[u8], length: usize| {
        let mut header = signature.to_vec();
        header.resize(length, 0);
        header[length - if length == 30 { 4 } else { 18 }..][..2].copy_from_slice(&u16::MAX.to_le_bytes());
        header.extend([b'x'; 65535]);
        header
    };
    let bytes = File::new(2, 0, 5).bytes();
    let (files, end) = bytes.split_at(bytes.len() - 22);
    let number = |at: usize| u32::from_le_bytes(end[at..at + 4].try_into().unwrap());
    let (size, start) = (number(12), number(16));
    let (files, directory) = files.split_at(start as usize);
    let (local, mut central) = (header(b"PK\x03\x04", 30), header(b"PK\x01\x02", 46));
    central[42..46].copy_from_slice(&start.to_le_bytes());
    let mut end = end.to_vec();
    end[8] += 1;
    end[10] += 1;
    end[12..16].copy_from_slice(&(size + central.len() as u32).to_le_bytes());
    end[16..20].copy_from_slice(&(start + local.len() as u32).to_le_bytes());
    let bytes = [files, &local, directory, &central, &end].concat();
    assert_eq!(unzip(&bytes).len(), 7);
    let reason = refused(&bytes);
    assert!(reason.starts_with("a ZIP that cannot be written again"), "{reason}");
}
