//! Addresses at which a store gives out an artifact itself, or takes one, for a short time, from whoever has them.
use std::time::Duration;

use object_store::signer::Method;

use super::place::Service;
use super::{ArtifactPath, ArtifactStore, Place, StoreResult};

/// Most bytes that one request brings, and one copy: Azure's limit, a little below that of S3.
const MOST_AT_ONCE: u64 = 5000 << 20;
/// What Azure has to be told.
const AZURE_HEADERS: [(&str, &str); 1] = [("x-ms-blob-type", "BlockBlob")];

/// An address to write at.
#[derive(Clone, Debug)]
pub struct UploadUrl {
    /// The address, for a PUT.
    pub url: String,
    /// Names and values of headers that go with it.
    pub headers: &'static [(&'static str, &'static str)],
}

impl ArtifactStore {
    /// An address for reading an artifact, good for so long; none where the store has none to give.
    pub async fn download_url(&self, path: &ArtifactPath, lifetime: Duration) -> StoreResult<Option<String>> {
        self.signed(Method::GET, path, lifetime).await
    }

    /// An address for writing `size` bytes, good for so long; none where the store has none to give, or takes so many in
    /// parts only. Nothing keeps whoever has it from sending other bytes, more of them, or some again.
    pub async fn upload_url(
        &self,
        path: &ArtifactPath,
        size: u64,
        lifetime: Duration,
    ) -> StoreResult<Option<UploadUrl>> {
        if size > MOST_AT_ONCE {
            return Ok(None);
        }
        let headers: &[_] = match self.place() {
            Place::Container {
                service: Service::Azure,
                ..
            } => &AZURE_HEADERS,
            Place::Container { .. } | Place::Folder(_) => &[],
        };
        let url = self.signed(Method::PUT, path, lifetime).await?;
        Ok(url.map(|url| UploadUrl { url, headers }))
    }

    async fn signed(&self, method: Method, path: &ArtifactPath, lifetime: Duration) -> StoreResult<Option<String>> {
        let Some(signer) = &self.inner.signer else {
            return Ok(None);
        };
        let url = self
            .answered(signer.signed_url(method, path.as_object_path(), lifetime))
            .await?;
        Ok(Some(url.into()))
    }
}
