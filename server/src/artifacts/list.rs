//! What lies in the store, whoever put it there: to find bytes that no row points at.
use futures::stream::{BoxStream, StreamExt, TryStreamExt, iter};

use super::{ArtifactPath, ArtifactStore, StoreResult};

/// Bytes at a path of an artifact.
#[derive(Clone, Debug)]
pub struct Listed {
    /// The path.
    pub path: ArtifactPath,
    /// When they were written, by the store's clock, in microseconds since 1970.
    pub written: i64,
}

impl ArtifactStore {
    /// All that lies at paths of artifacts. Whatever else there is, this program did not write: a bucket may have other
    /// uses.
    pub fn list(&self) -> BoxStream<'static, StoreResult<Listed>> {
        let store = self.inner.objects.clone();
        iter(ArtifactPath::roots())
            .flat_map(move |root| store.list(Some(&root)))
            .map_err(Into::into)
            .try_filter_map(|found| async move {
                let path = ArtifactPath::parse(found.location.as_ref()).ok();
                Ok(path.map(|path| Listed {
                    path,
                    written: found.last_modified.timestamp_micros(),
                }))
            })
            .boxed()
    }
}
