//! Names of jobs, artifacts, keys, owners and assets as people type them.
use uuid::Uuid;

use crate::error::{Error, Result};

/// `jobs/ID`, from that or from the id alone.
pub fn job(text: &str) -> Result<String> {
    whole("jobs", text).ok_or_else(|| Error::BadOption {
        field: "JOB",
        reason: format!("`{text}` is not the name of a job, which is jobs/ and an id"),
    })
}

/// `artifacts/ID`, from that or from the id alone.
pub fn artifact(text: &str) -> Result<String> {
    whole("artifacts", text).ok_or_else(|| Error::BadOption {
        field: "ARTIFACT",
        reason: format!("`{text}` is not the name of an artifact, which is artifacts/ and an id"),
    })
}

/// `artifacts/ID` where a file could stand too: only the whole name is one.
pub fn artifact_or_file(text: &str) -> Option<String> {
    text.strip_prefix("artifacts/")?;
    whole("artifacts", text)
}

/// `assets/ID`, from that or from the id alone.
pub fn asset(text: &str) -> Result<String> {
    whole("assets", text).ok_or_else(|| Error::BadOption {
        field: "ASSET",
        reason: format!("`{text}` is not the name of an asset, which is assets/ and an id"),
    })
}

/// `commitments/ID`, where an asset could stand too: only the whole name is one.
pub fn commitment(text: &str) -> Option<String> {
    text.strip_prefix("commitments/")?;
    whole("commitments", text)
}

/// `tokens/ID`, from that or from the id alone.
pub fn token(text: &str) -> Result<String> {
    whole("tokens", text).ok_or_else(|| Error::BadOption {
        field: "TOKEN",
        reason: format!("`{text}` is not the name of a token, which is tokens/ and an id"),
    })
}

/// `hooks/ID`, from that or from the id alone.
pub fn hook(text: &str) -> Result<String> {
    whole("hooks", text).ok_or_else(|| Error::BadOption {
        field: "HOOK",
        reason: format!("`{text}` is not the name of a hook, which is hooks/ and an id"),
    })
}

/// `deliveries/ID`, from that or from the id alone.
pub fn delivery(text: &str) -> Result<String> {
    whole("deliveries", text).ok_or_else(|| Error::BadOption {
        field: "DELIVERY",
        reason: format!("`{text}` is not the name of a delivery, which is deliveries/ and an id"),
    })
}

/// `owners/ID`, from that or from the id alone; `None` is for what may be a display name.
pub fn owner(text: &str) -> Option<String> {
    whole("owners", text)
}

/// `keys/ID`, from that or from the id alone; `None` is for what may be a display name.
pub fn key(text: &str) -> Option<String> {
    whole("keys", text)
}

fn whole(collection: &str, text: &str) -> Option<String> {
    let id = match text.split_once('/') {
        Some((before, id)) if before == collection => id,
        Some(_) => return None,
        None => text,
    };
    Some(format!("{collection}/{}", Uuid::try_parse(id).ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ID: &str = "0190a5d0-1111-7abc-8def-000000000001";

    #[test]
    fn ids_may_stand_alone() {
        let name = format!("jobs/{ID}");
        assert_eq!(job(&name).unwrap(), name);
        assert_eq!(job(ID).unwrap(), name);
        assert_eq!(job(&ID.to_uppercase()).unwrap(), name);
        assert_eq!(key(ID).unwrap(), format!("keys/{ID}"));
    }

    #[test]
    fn what_is_no_name_is_told() {
        for wrong in [
            "",
            "jobs/",
            "jobs/7",
            "keys/0190a5d0-1111-7abc-8def-000000000001",
            "jobs/a/b",
            "../x",
        ] {
            let error = job(wrong).unwrap_err().to_string();
            assert!(error.contains("jobs/ and an id"), "{error}");
        }
        assert!(artifact("x").is_err());
        assert!(asset(&format!("keys/{ID}")).is_err() && asset(ID).is_ok());
        assert_eq!((owner("Studio Nord"), owner(ID)), (None, Some(format!("owners/{ID}"))));
        assert_eq!(key("website"), None);
    }

    #[test]
    fn files_are_not_taken_for_artifacts() {
        assert_eq!(artifact_or_file("artifacts/scene.ply"), None);
        assert_eq!(artifact_or_file(ID), None);
        assert!(artifact_or_file(&format!("artifacts/{ID}")).is_some());
    }
}
