//! What the server reads of callers, and of its own folder.
use crate::memory::bounded;
use guardsplat_server::grpc::fuzz_api;
use guardsplat_server::secrets::MasterKey;
use guardsplat_server::settings;
use std::sync::LazyLock;

/// Page tokens: one that is taken is the one that would be given.
pub fn page_token(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(Some(token)) = bounded(data.len(), || fuzz_api::page_token(text)) {
        assert_eq!(token, text);
    }
}

/// Names of resources, for people and of files.
pub fn names(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    bounded(data.len(), || {
        if let Ok(name) = fuzz_api::name(text) {
            assert_eq!(name, text);
        }
        if fuzz_api::file_name(text).is_ok() {
            assert!(!text.contains(['/', '\\', '\n']) && text != "..");
        }
        let _ = fuzz_api::display_name(text);
    });
}

/// Requests on the wire: jobs, and what uploads announce.
pub fn requests(data: &[u8]) {
    let _ = bounded(data.len(), || fuzz_api::create_job(data));
    let _ = bounded(data.len(), || fuzz_api::announce(data));
}

/// Key files as the server keeps them, under a master key of zeros; and master keys.
pub fn sealed(data: &[u8]) {
    static MASTER: LazyLock<MasterKey> =
        LazyLock::new(|| MasterKey::from_hex(&"0".repeat(64), "fuzz").expect("64 digits are a key"));
    let _ = bounded(data.len(), || MASTER.open("keys/fuzz", data));
    if let Ok(text) = std::str::from_utf8(data) {
        let _ = bounded(data.len(), || MasterKey::from_hex(text, "fuzz"));
    }
}

/// The server's file of settings.
pub fn server_settings(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(settings) = bounded(data.len(), || settings::parse(text)) {
        settings.check().expect("settings that were taken are checked");
    }
}
