//! Notifications of object stores: the JSON that S3 and those that speak its language (MinIO, Ceph) send when something
//! was put into a bucket.
use percent_encoding::percent_decode_str;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use uuid::{Builder, Uuid};

/// What a notification is of that matters here.
const CREATED: &str = "ObjectCreated:";

#[derive(Deserialize)]
struct Notification {
    #[serde(rename = "Records", default)]
    records: Vec<Record>,
}

#[derive(Deserialize)]
struct Record {
    #[serde(rename = "eventName", default)]
    event: String,
    s3: Place,
}

#[derive(Deserialize)]
struct Place {
    bucket: Bucket,
    object: Described,
}

#[derive(Deserialize)]
struct Bucket {
    name: String,
}

#[derive(Deserialize)]
struct Described {
    key: String,
    #[serde(rename = "eTag", default)]
    etag: String,
    #[serde(rename = "versionId", default)]
    version: Option<String>,
    #[serde(default)]
    size: Option<u64>,
}

/// An object that was put into a bucket.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Object {
    /// Where.
    pub bucket: String,
    /// What it is called there.
    pub key: String,
    /// Which of those that were called so: its version, else what the store says of its content.
    pub version: String,
    /// Its length, if that was told.
    pub size: Option<u64>,
}

impl Object {
    /// Names the request for this object: the same for the same bucket, key and version (a UUID of version 8, which
    /// leaves its bits to us).
    pub fn request_id(&self) -> Uuid {
        let mut hash = Sha256::new_with_prefix(b"guardsplat s3 object\0");
        for part in [&self.bucket, &self.key, &self.version] {
            hash.update(part.as_bytes());
            // Neither can be in a name.
            hash.update(b"\0");
        }
        let hash = hash.finalize();
        Builder::from_custom_bytes(std::array::from_fn(|i| hash[i])).into_uuid()
    }

    /// The parts of its key as folders and a file; none where they would lead elsewhere.
    pub fn path(&self) -> Option<Vec<&str>> {
        let parts: Vec<&str> = self.key.split('/').collect();
        let plain = |part: &&str| !matches!(*part, "" | "." | "..") && !part.contains(['\\', '\0', ':']);
        parts.iter().all(plain).then_some(parts)
    }
}

/// Objects that a notification says were put somewhere. Other news is none.
///
/// # Errors
/// What is wrong with it.
pub fn created(body: &[u8]) -> Result<Vec<Object>, String> {
    let told: Notification = serde_json::from_slice(body).map_err(|error| error.to_string())?;
    let of_creation = |record: &Record| {
        let event = &record.event;
        event.strip_prefix("s3:").unwrap_or(event).starts_with(CREATED)
    };
    told.records.into_iter().filter(of_creation).map(object).collect()
}

fn object(record: Record) -> Result<Object, String> {
    let Place { bucket, object } = record.s3;
    // As in forms: a plus is a space.
    let spaced = object.key.replace('+', " ");
    let key = percent_decode_str(&spaced)
        .decode_utf8()
        .map_err(|_| format!("the key {:?} is no text", object.key))?;
    // "null" is what stores without versions say.
    let version = object
        .version
        .filter(|version| !matches!(version.as_str(), "" | "null"));
    Ok(Object {
        bucket: bucket.name,
        key: key.into_owned(),
        version: version.unwrap_or_else(|| object.etag.trim_matches('"').to_owned()),
        size: object.size,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As AWS has it in its documentation, shortened.
    const AWS: &str = r#"{"Records":[{"eventVersion":"2.1","eventSource":"aws:s3","awsRegion":"us-west-2",
        "eventTime":"1970-01-01T00:00:00.000Z","eventName":"ObjectCreated:Put","s3":{"s3SchemaVersion":"1.0",
        "bucket":{"name":"uploads","ownerIdentity":{"principalId":"A3NL1KOZZKExample"},"arn":"arn:aws:s3:::uploads"},
        "object":{"key":"red+flower/%C3%A9t%C3%A9+1%2B1.ply","size":1024,"eTag":"d41d8cd98f00b204e9800998ecf8427e",
        "versionId":"096fKKXTRTtl3on89fVO.nfljtsv6qko","sequencer":"0055AED6DCD90281E5"}}}]}"#;
    /// As MinIO sends it, shortened.
    const MINIO: &str = r#"{"EventName":"s3:ObjectCreated:CompleteMultipartUpload","Key":"uploads/a/b.spz","Records":[
        {"eventVersion":"2.0","eventSource":"minio:s3","eventName":"s3:ObjectCreated:CompleteMultipartUpload",
        "s3":{"bucket":{"name":"uploads"},"object":{"key":"a%2Fb.spz","eTag":"\"77-2\"","versionId":"null"}}}]}"#;

    #[test]
    fn notifications_of_several_stores_are_read() {
        let aws = created(AWS.as_bytes()).unwrap();
        let expected = Object {
            bucket: "uploads".into(),
            key: "red flower/été 1+1.ply".into(),
            version: "096fKKXTRTtl3on89fVO.nfljtsv6qko".into(),
            size: Some(1024),
        };
        assert_eq!(aws, [expected]);
        let minio = created(MINIO.as_bytes()).unwrap().remove(0);
        assert_eq!((minio.key.as_str(), minio.version.as_str()), ("a/b.spz", "77-2"));
        assert_eq!(minio.path(), Some(vec!["a", "b.spz"]));
    }

    #[test]
    fn other_news_is_none_and_nonsense_is_told() {
        let removed = AWS.replace("ObjectCreated:Put", "ObjectRemoved:Delete");
        let test = r#"{"Service":"Amazon S3","Event":"s3:TestEvent","Bucket":"uploads"}"#;
        for none in [removed.as_str(), test, "{}", r#"{"Records":[]}"#] {
            assert_eq!(created(none.as_bytes()), Ok(Vec::new()), "{none}");
        }
        let no_text = AWS.replace("%C3%A9t", "%FFt");
        for wrong in [
            "",
            "[]x",
            r#"{"Records":[{"eventName":"ObjectCreated:Put"}]}"#,
            no_text.as_str(),
        ] {
            assert!(created(wrong.as_bytes()).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_same_object_is_the_same_request() {
        let one = created(AWS.as_bytes()).unwrap().remove(0);
        assert_eq!(one.request_id(), one.clone().request_id());
        assert_eq!(one.request_id().get_version_num(), 8);
        let others = [
            Object {
                bucket: "uploadsred".into(),
                key: " flower/été 1+1.ply".into(),
                ..one.clone()
            },
            Object {
                key: "b.ply".into(),
                ..one.clone()
            },
            Object {
                version: "2".into(),
                ..one.clone()
            },
        ];
        for other in others {
            assert_ne!(other.request_id(), one.request_id());
        }
    }

    #[test]
    fn keys_lead_nowhere_else() {
        let with = |key: &str| Object {
            bucket: "b".into(),
            key: key.into(),
            version: "1".into(),
            size: None,
        };
        for wrong in [
            "",
            "/etc/passwd",
            "../a.ply",
            "a/../../b.ply",
            "a//b.ply",
            "a/",
            ".",
            "a\\b.ply",
            "c:/a.ply",
            "a\0.ply",
        ] {
            assert_eq!(with(wrong).path(), None, "{wrong:?}");
        }
        assert_eq!(with("a/..b/c.ply").path(), Some(vec!["a", "..b", "c.ply"]));
    }
}
