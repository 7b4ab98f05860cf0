//! What an upload announces: its name, its length and its SHA-256, checked before any byte arrives.
use guardsplat_proto::v1::UploadMetadata;

use crate::artifacts::Announced;
use crate::error::Result;
use crate::service::text;
use crate::service::violations::Problems;

/// Checks what an upload announces; `field` is where that stands in the request.
pub fn announced(field: &str, metadata: &UploadMetadata) -> Result<Announced> {
    let mut problems = Problems::default();
    problems.take(text::file_name(
        &format!("{field}.display_name"),
        &metadata.display_name,
    ))?;
    let size = u64::try_from(metadata.size_bytes).ok().filter(|&size| size > 0);
    problems.check(
        size.is_some(),
        &format!("{field}.size_bytes"),
        "must be the length in bytes, at least 1",
    );
    let sha256 = digest(&metadata.sha256);
    problems.check(
        sha256.is_some(),
        &format!("{field}.sha256"),
        "must be 64 hexadecimal digits in lower case",
    );
    problems.finish()?;
    // Both were found to be there.
    Ok(Announced {
        size: size.unwrap_or_default(),
        sha256: sha256.unwrap_or_default(),
    })
}

/// A SHA-256 in lower-case hexadecimal.
pub fn digest(text: &str) -> Option<[u8; 32]> {
    let mut bytes = [0; 32];
    let valid = text.len() == 64 && !text.bytes().any(|b| b.is_ascii_uppercase());
    (valid && hex::decode_to_slice(text, &mut bytes).is_ok()).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn everything_wrong_is_told_at_once() {
        let metadata = UploadMetadata {
            display_name: "../x".into(),
            size_bytes: -1,
            sha256: "F".repeat(64),
        };
        let Err(Error::Invalid(violations)) = announced("metadata", &metadata) else {
            panic!("was taken")
        };
        let fields: Vec<_> = violations.iter().map(|v| v.field.as_str()).collect();
        assert_eq!(
            fields,
            ["metadata.display_name", "metadata.size_bytes", "metadata.sha256"]
        );
    }

    #[test]
    fn digests_have_one_spelling() {
        assert_eq!(digest(&"0f".repeat(32)), Some([15; 32]));
        for bad in [
            "",
            &"0F".repeat(32),
            &"0f".repeat(33),
            &"0g".repeat(32),
            &"é".repeat(32),
        ] {
            assert_eq!(digest(bad), None, "{bad}");
        }
    }
}
