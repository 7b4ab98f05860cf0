//! Key files come back as they were written, and damaged ones are refused with a reason.
use super::*;

fn key() -> Key {
    let mut projection = Projection::identity(6);
    projection.mean_text[2] = 0.25;
    Key {
        secret: Secret::from_seed(5),
        seed: Some(5),
        coded_bits: None,
        bits_per_token: 1,
        clip: ClipIdentity {
            name: "tiny".into(),
            hash: "ab".repeat(32),
        },
        decoding: Decoding::Clip {
            projection,
            decoder: DecoderWeights::seeded(6, 32, 1),
        },
        accuracy_unseen: Some(0.999),
        accuracy_unseen_noisy: None,
    }
}

/// Why a file is refused in which `to` stands where `from` stood first.
fn refused_with(bytes: &[u8], from: &[u8], to: &[u8]) -> String {
    let at = bytes.windows(from.len()).position(|w| w == from).unwrap();
    let mut changed = bytes.to_vec();
    changed[at..at + to.len()].copy_from_slice(to);
    deserialize(&changed).unwrap_err()
}

#[test]
fn round_trip_is_exact_and_bytes_repeat() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("k");
    let key = key();
    key.write(&path).unwrap();
    assert_eq!(Key::read(&path).unwrap(), key);
    assert_eq!(std::fs::read(&path).unwrap(), key.to_bytes().unwrap());
    assert_eq!(Key::from_bytes("k", &key.to_bytes().unwrap()).unwrap(), key);
    let error = Key::from_bytes("k", b"nothing").unwrap_err().to_string();
    assert!(error.starts_with("key k: not a key file"), "{error}");
    assert_eq!(serialize(&key).unwrap(), serialize(&key.clone()).unwrap());
    key.write(&path).unwrap(); // replaces
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn convolutional_decoders_are_kept_and_checked() {
    let weights = guardsplat_hidden::Weights::seeded(4, 3).unwrap();
    let key = Key {
        decoding: Decoding::Hidden(weights),
        ..key()
    };
    let bytes = key.to_bytes().unwrap();
    assert_eq!(Key::from_bytes("k", &bytes).unwrap(), key);
    assert_eq!(key.bits(), 4);
    let with = |from: &[u8], to: &[u8]| refused_with(&bytes, from, to);
    assert!(with(b"extractor\\\":\\\"hidden", b"extractor\\\":\\\"magics").contains("\"magics\", which this"));
    assert!(with(b"bits\\\":4", b"bits\\\":5").contains("hidden.head.weight is F32 [48, 4], not F32 [48, 5]"));
    assert!(with(b"hidden.head.bias", b"hidden.head.bia5").contains("hidden.head.bias is missing"));
    let mut last = bytes.clone();
    *last.last_mut().unwrap() ^= 1;
    assert!(deserialize(&last).is_err());
}

#[test]
fn keys_of_coded_messages_are_kept_and_checked() {
    let key = Key {
        coded_bits: Some(16),
        decoding: Decoding::Clip {
            projection: Projection::identity(64),
            decoder: DecoderWeights::seeded(64, 64, 1),
        },
        ..key()
    };
    assert_eq!((key.bits(), key.word_bits()), (16, 64));
    let bytes = key.to_bytes().unwrap();
    let read = Key::from_bytes("k", &bytes).unwrap();
    assert_eq!(read, key);
    assert_ne!(
        key.id(),
        Key {
            coded_bits: None,
            ..key.clone()
        }
        .id()
    );
    let message = key.message("c0de").unwrap();
    let word = read.message_code().unwrap().word(&message).unwrap();
    assert_eq!(word, key.message_code().unwrap().word(&message).unwrap());
    // Another secret has another pad.
    let other = Key {
        secret: Secret::from_seed(6),
        ..key.clone()
    };
    assert_ne!(other.message_code().unwrap().word(&message).unwrap(), word);
    let with = |from: &[u8], to: &[u8]| refused_with(&bytes, from, to);
    assert!(with(b"bits\\\":16", b"bits\\\":17").contains("17 bits are not put into words of 64"));
    assert!(with(b"bits\\\":16", b"bits\\\":15").contains("does not match its id"));
    assert!(with(b"word_bits\\\":64", b"word_bits\\\":65").contains("are not put into words of 65"));
}

#[cfg(unix)]
#[test]
fn only_the_owner_can_read_it() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("k");
    key().write(&path).unwrap();
    assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
}

#[test]
fn a_missing_folder_is_an_error_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("no/k");
    assert!(matches!(key().write(&path), Err(Error::Io { .. })));
    assert!(matches!(Key::read(&path), Err(Error::Io { .. })));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn truncation_anywhere_is_found() {
    let bytes = serialize(&key()).unwrap();
    for length in (0..bytes.len()).step_by(997).chain([0, 7, 8, 9, bytes.len() - 1]) {
        assert!(deserialize(&bytes[..length]).is_err(), "{length}");
    }
}

#[test]
fn headers_of_megabytes_are_not_parsed() {
    let file = [&(64u64 << 20).to_le_bytes()[..], &vec![b'['; 64 << 20]].concat();
    assert!(
        deserialize(&file)
            .unwrap_err()
            .contains("its header promises 67108864 bytes")
    );
}

#[test]
fn changed_weights_are_found() {
    let mut bytes = serialize(&key()).unwrap();
    let last = bytes.len() - 4;
    bytes[last] ^= 1;
    assert!(deserialize(&bytes).unwrap_err().contains("does not match its id"));
}

#[test]
fn other_headers_are_refused_with_a_reason() {
    let bytes = serialize(&key()).unwrap();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let start = text.find("\\\"version\\\":1").unwrap();
    let with = |from: &[u8], to: &[u8]| refused_with(&bytes, from, to);
    assert!(start > 0);
    assert!(with(b"version\\\":1", b"version\\\":2").contains("version 2"));
    assert!(with(b"bits\\\":32", b"bits\\\":99").contains("1 is outside 2 to 4"));
    assert!(with(b"bits\\\":32", b"bits\\\":31").contains("decoder.2.weight is F32 [256, 32]"));
    assert!(with(b"guardsplat_key", b"guardsplat_kex").contains("not a key"));
    assert!(with(b"projection.noise", b"projection.moise").contains("projection.noise is missing"));
    assert!(
        deserialize(b"ply\nformat ascii 1.0\n")
            .unwrap_err()
            .contains("not a key file")
    );
}
