//! Seals hold against every change, and a data folder keeps to its master key.
use std::fs;
use std::os::unix::fs::PermissionsExt;

use proptest::prelude::*;
use secrecy::{ExposeSecret, SecretString};
use tempfile::TempDir;

use super::*;

const DIGITS: &str = "000102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f";
const OTHER: &str = "ff0102030405060708090a0b0c0d0e0f101112131415161718191a1b1c1d1e1f";

fn key() -> MasterKey {
    MasterKey::from_hex(DIGITS, "test").unwrap()
}

#[test]
fn opens_what_it_sealed() {
    for secret in [&b""[..], b"s", &[7; 70_000]] {
        let sealed = key().seal("keys/1", secret).unwrap();
        assert_eq!(key().open("keys/1", &sealed).unwrap().expose_secret(), secret);
    }
}

#[test]
fn two_seals_of_one_secret_differ_and_show_nothing_of_it() {
    let secret = b"a secret that is long enough to be found";
    let (a, b) = (key().seal("c", secret).unwrap(), key().seal("c", secret).unwrap());
    assert_ne!(a, b);
    assert!(!a.windows(8).any(|w| secret.windows(8).any(|s| s == w)));
}

/// The format stays readable: a text that version 1 made.
#[test]
fn version_1_opens() {
    let sealed = hex::decode(include_str!("version_1.hex").trim()).unwrap();
    assert_eq!(
        key().open("keys/7", &sealed).unwrap().expose_secret(),
        b"sealed by version 1"
    );
}

#[test]
fn another_key_context_version_or_length_is_told() {
    let sealed = key().seal("keys/1", b"secret").unwrap();
    let other = MasterKey::from_hex(OTHER, "test").unwrap();
    assert!(matches!(
        other.open("keys/1", &sealed),
        Err(SecretError::WrongKey { needed, given }) if needed == key().id() && given == other.id()
    ));
    assert!(matches!(key().open("keys/2", &sealed), Err(SecretError::Altered)));
    assert!(matches!(
        key().open("keys/1", &sealed[..20]),
        Err(SecretError::NotSealed)
    ));
    assert!(matches!(
        key().open("keys/1", &sealed[..sealed.len() - 1]),
        Err(SecretError::Altered)
    ));
    assert!(matches!(
        key().open("keys/1", b"plain text that is long enough for a header"),
        Err(SecretError::NotSealed)
    ));
    let mut newer = sealed;
    newer[4] = 9;
    assert!(matches!(
        key().open("keys/1", &newer),
        Err(SecretError::UnknownVersion { found: 9, known: 1 })
    ));
}

proptest! {
    /// Whichever bit is turned, nothing opens.
    #[test]
    fn every_changed_bit_is_noticed(
        secret in prop::collection::vec(any::<u8>(), 0..64),
        at in any::<prop::sample::Index>(),
        bit in 0..8u8,
    ) {
        let mut sealed = key().seal("c", &secret).unwrap();
        let at = at.index(sealed.len());
        sealed[at] ^= 1u8 << bit;
        prop_assert!(key().open("c", &sealed).is_err());
    }
}

#[test]
fn debug_and_errors_show_nothing() {
    let text = format!("{:?}", key());
    assert!(
        text.contains("REDACTED") && !text.contains("0001020") && !text.contains("[0, 1, 2"),
        "{text}"
    );
    let error = MasterKey::from_hex("0123456789 not a key", "GUARDSPLAT_MASTER_KEY").unwrap_err();
    assert_eq!(
        error.to_string(),
        "GUARDSPLAT_MASTER_KEY: not a master key, which has 64 hexadecimal digits"
    );
    assert!(!format!("{error:?}").contains("0123456789"));
    let digits = SecretString::from(DIGITS);
    assert!(!format!("{:?}", KeySource::Environment(&digits)).contains("0001"));
}

#[test]
fn a_new_data_folder_gets_a_key_that_only_its_owner_reads() {
    let folder = TempDir::new().unwrap();
    let first = load(KeySource::DataFolder, folder.path()).unwrap();
    let file = folder.path().join("master.key");
    assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
    assert_eq!(fs::read_to_string(&file).unwrap().trim().len(), 64);
    let again = load(KeySource::DataFolder, folder.path()).unwrap();
    assert_eq!(first.id(), again.id());
    let sealed = first.seal("c", b"secret").unwrap();
    assert_eq!(again.open("c", &sealed).unwrap().expose_secret(), b"secret");
    let another = TempDir::new().unwrap();
    assert_ne!(load(KeySource::DataFolder, another.path()).unwrap().id(), first.id());
}

#[test]
fn a_lost_key_is_not_replaced() {
    let folder = TempDir::new().unwrap();
    load(KeySource::DataFolder, folder.path()).unwrap();
    fs::remove_file(folder.path().join("master.key")).unwrap();
    let error = load(KeySource::DataFolder, folder.path()).unwrap_err();
    assert!(matches!(error, SecretError::Missing { .. }), "{error}");
    assert!(!folder.path().join("master.key").exists());
}

#[test]
fn a_data_folder_keeps_to_its_key() {
    let folder = TempDir::new().unwrap();
    let (digits, other) = (SecretString::from(DIGITS), SecretString::from(OTHER));
    load(KeySource::Environment(&digits), folder.path()).unwrap();
    assert!(!folder.path().join("master.key").exists());
    load(KeySource::Environment(&digits), folder.path()).unwrap();
    let error = load(KeySource::Environment(&other), folder.path()).unwrap_err();
    assert!(matches!(error, SecretError::OtherKey { .. }), "{error}");
    let error = load(KeySource::DataFolder, folder.path()).unwrap_err();
    assert!(matches!(error, SecretError::Missing { .. }), "{error}");
    // The same key, from a file.
    let file = folder.path().join("mounted");
    fs::write(&file, format!("  {}\n", DIGITS.to_uppercase())).unwrap();
    load(KeySource::File(&file), folder.path()).unwrap();
}

#[test]
fn a_bad_key_file_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("short");
    let error = load(KeySource::File(&file), folder.path()).unwrap_err();
    assert!(error.to_string().contains("short: "), "{error}");
    fs::write(&file, "abcd").unwrap();
    let error = load(KeySource::File(&file), folder.path()).unwrap_err();
    assert!(
        error
            .to_string()
            .ends_with("short: not a master key, which has 64 hexadecimal digits"),
        "{error}"
    );
    // Nothing of a failed start stays, so the next one is as the first.
    assert!(!folder.path().join("master.id").exists());
}
