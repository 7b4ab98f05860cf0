//! Which store a URL names: a folder, or a container of S3, GCS or Azure, and what paths in it begin with.
use std::fmt;
use std::path::PathBuf;

use object_store::path::Path;

/// Most bytes of a URL; what stores take as names is far below.
const MAX_BYTES: usize = 1024;

/// Where artifacts are, when not in the data folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A folder, of which this process sees all there is.
    Folder(PathBuf),
    /// A container of a service.
    Container {
        /// Whose.
        service: Service,
        /// Its name: that of a bucket, or a container as Azure calls it.
        name: String,
        /// What paths in it begin with; may be empty.
        prefix: Path,
    },
}

/// Whose interface a store has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Amazon S3, and what speaks as it does.
    S3,
    /// Google Cloud Storage.
    Google,
    /// Azure Blob Storage.
    Azure,
}

impl Service {
    const ALL: [(Self, &str); 3] = [(Self::S3, "s3"), (Self::Google, "gs"), (Self::Azure, "az")];

    fn scheme(self) -> &'static str {
        match self {
            Self::S3 => "s3",
            Self::Google => "gs",
            Self::Azure => "az",
        }
    }
}

impl Place {
    /// Reads a URL.
    ///
    /// # Errors
    /// What is wrong with it. The text repeats nothing of it: somebody may have put a password there.
    pub fn parse(url: &str) -> Result<Self, String> {
        let unknown = || {
            "begins with none of s3://, gs://, az:// and file:///; the folder artifacts in the data folder is taken \
             when nothing is set"
                .to_owned()
        };
        if url.len() > MAX_BYTES {
            return Err(format!("has {} bytes, and at most {MAX_BYTES} are taken", url.len()));
        }
        let (scheme, rest) = url.split_once("://").ok_or_else(unknown)?;
        if scheme == "file" {
            return folder(rest);
        }
        let (service, _) = Service::ALL
            .into_iter()
            .find(|(_, known)| *known == scheme)
            .ok_or_else(unknown)?;
        if rest.contains(['@', '?', '#', '%']) {
            return Err(
                "has more than a name and a prefix; credentials and endpoints are taken from the environment".into(),
            );
        }
        let (name, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        if !is_name(name) {
            return Err("names no bucket: letters, digits, '-', '.' and '_' are taken".into());
        }
        let prefix = prefix.strip_suffix('/').unwrap_or(prefix);
        if !prefix.is_empty() && !prefix.split('/').all(is_name) {
            return Err("has a prefix with more than letters, digits, '-', '.' and '_' between slashes".into());
        }
        Ok(Self::Container {
            service,
            name: name.to_owned(),
            prefix: Path::from(prefix),
        })
    }
}

fn folder(rest: &str) -> Result<Place, String> {
    let path = PathBuf::from(rest);
    if !path.is_absolute() {
        return Err("names no folder from the root on, as file:///srv/artifacts does".into());
    }
    Ok(Place::Folder(path))
}

fn is_name(part: &str) -> bool {
    let taken = |b: u8| b.is_ascii_alphanumeric() || b"-._".contains(&b);
    !part.is_empty() && part.bytes().all(taken) && !part.bytes().all(|b| b == b'.')
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(path) => write!(f, "{}", path.display()),
            Self::Container { service, name, prefix } if prefix.as_ref().is_empty() => {
                write!(f, "{}://{name}", service.scheme())
            }
            Self::Container { service, name, prefix } => write!(f, "{}://{name}/{prefix}", service.scheme()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn urls_name_what_they_show() {
        for url in [
            "s3://bucket",
            "s3://my.bucket-1/a/b_c",
            "gs://under_score/x",
            "az://container/guard.splat",
        ] {
            assert_eq!(Place::parse(url).unwrap().to_string(), url);
            assert_eq!(Place::parse(&format!("{url}/")).unwrap(), Place::parse(url).unwrap());
        }
        assert_eq!(
            Place::parse("file:///srv/artifacts").unwrap(),
            Place::Folder("/srv/artifacts".into())
        );
    }

    #[test]
    fn what_is_wrong_is_told_without_repeating_it() {
        for url in [
            "",
            "/srv/5ec2e7",
            "s3:5ec2e7",
            "http://5ec2e7/x",
            "s3://",
            "s3:///5ec2e7",
            "s3://5ec2e7:key@bucket",
            "s3://bucket?key=5ec2e7",
            "s3://bucket/5ec2e7/../x",
            "s3://bucket//5ec2e7",
            "s3://../5ec2e7",
            "az://5ec2e7@account/x",
            "gs://bucket/%2e%2e/5ec2e7",
            "file://5ec2e7/x",
        ] {
            let error = Place::parse(url).unwrap_err();
            assert!(!error.contains("5ec2e7"), "{url}: {error}");
        }
        assert!(Place::parse(&format!("s3://{}", "a".repeat(2000))).is_err());
    }
}
