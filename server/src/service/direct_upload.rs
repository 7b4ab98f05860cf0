//! `StartUpload` and `FinishUpload`: uploads whose bytes go to the store without the server. Those that come in parts begin
//! and end here too (`upload_parts`).
//!
//! All that is known of one before it is finished is sealed in its name. Where a project may have so many bytes only, those
//! that were announced are reserved until there is an artifact, or nothing more can come of it. The bytes lie where the
//! client may write for as long as the address is good, so they are copied to where it may not, and the copy is checked.
//! Only then there is a row, so a row that is there is of bytes that are right, whoever made it: a call that comes twice,
//! even at once, gives one artifact.
use std::time::Duration;

use base64::Engine;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use guardsplat_proto::v1::{HttpHeader, StartUploadResponse, UploadMetadata};
use prost::Message;
use secrecy::ExposeSecret;
use uuid::Uuid;

use crate::artifacts::{Announced, ArtifactPath, Check, StoreError};
use crate::error::{Error, Result, chain};
use crate::ledger::{ArtifactRow, NewArtifact, Origin, UploadReservation};
use crate::service::concurrency_limit::Permit;
use crate::service::{Service, clock, upload};

/// What names of uploads begin with.
const COLLECTION: &str = "uploads/";
/// What was finished in time has been copied so long after.
const LAST_COPY: Duration = Duration::from_secs(10 * 60);
/// Longest name that is looked at. Names hold an id, a time, and what was announced.
const MAX_NAME_BYTES: usize = 1024;

/// What is known of an upload that is not finished.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct PendingUpload {
    /// Id of the artifact to be.
    #[prost(bytes = "vec", tag = "1")]
    id: Vec<u8>,
    #[prost(int64, tag = "2")]
    pub(super) start_time: i64,
    #[prost(message, required, tag = "3")]
    pub(super) metadata: UploadMetadata,
    /// Whether the bytes come through the server, by `AppendUpload`.
    #[prost(bool, tag = "4")]
    pub(super) in_parts: bool,
}

impl PendingUpload {
    /// Bytes that were announced.
    pub(super) fn size(&self) -> u64 {
        u64::try_from(self.metadata.size_bytes).unwrap_or_default()
    }
}

impl Service {
    /// An address to send to, where the server is to give any and the store has some.
    pub(crate) async fn start(
        &self,
        project: &str,
        metadata: Option<UploadMetadata>,
        in_parts: bool,
    ) -> Result<StartUploadResponse> {
        let metadata = metadata.ok_or_else(|| Error::invalid("metadata", "is missing"))?;
        let announced = upload::announced("metadata", &metadata)?;
        Check::new(announced, self.store().max_bytes())?;
        self.room_for_bytes(project, announced.size).await?;
        if in_parts {
            return self.start_in_parts(project, metadata).await;
        }
        let Some(lifetime) = self.limits().signed_url else {
            return Ok(StartUploadResponse::default());
        };
        // What comes when it can't be finished any more would be sent for nothing.
        let lifetime = lifetime.min(self.limits().abandoned_after);
        let id = Uuid::now_v7();
        // From before it is signed, so that it is not good for longer than is said.
        let now = clock::now();
        let path = ArtifactPath::staged(id);
        let address = self.store().upload_url(&path, announced.size, lifetime).await?;
        let Some(address) = address else {
            return Ok(StartUploadResponse::default());
        };
        self.reserve_bytes(UploadReservation {
            id,
            project: project.to_owned(),
            size: metadata.size_bytes,
            address_end: now.saturating_add(clock::micros(lifetime)),
            end_time: self.end_of_reservation(now),
        })
        .await?;
        let headers = address.headers.iter().map(|&(name, value)| HttpHeader {
            name: name.to_owned(),
            value: value.to_owned(),
        });
        Ok(StartUploadResponse {
            upload: self.name_of_upload(project, id, now, metadata, false)?,
            url: address.url,
            headers: headers.collect(),
            expire_time: Some(clock::timestamp(now.saturating_add(clock::micros(lifetime)))),
        })
    }

    /// The artifact that was sent to an address or in parts, and whether it is new. `permit` is asked for where bytes have
    /// to be moved; an upload in parts has one already.
    pub(crate) async fn finish(
        &self,
        project: &str,
        name: &str,
        permit: impl FnOnce() -> Result<Option<Permit>>,
    ) -> Result<(ArtifactRow, bool)> {
        let (id, begun) = self.begun_upload(project, name)?;
        if begun.in_parts {
            return self.finish_in_parts(project, id, begun).await;
        }
        let _permit = permit()?;
        if let Some(row) = self.finished(id).await? {
            self.remove_staged(id).await;
            return Ok((row, false));
        }
        self.in_time(&begun)?;
        match self.take(project, id, begun.metadata).await {
            Ok(row) => {
                self.remove_staged(id).await;
                Ok((row, true))
            }
            Err(error) => {
                // The same call may have come at the same time, and have taken it away.
                if let Some(row) = self.finished(id).await? {
                    return Ok((row, false));
                }
                // What is worth another try stays for it.
                if matches!(error, Error::Invalid(_) | Error::QuotaUsedUp { .. }) {
                    self.remove_staged(id).await;
                    // It may be sent once more while the address is good.
                    self.ledger().end_with_address(id).await?;
                }
                Err(error)
            }
        }
    }

    /// The artifact, if there is a row of it.
    pub(super) async fn finished(&self, id: Uuid) -> Result<Option<ArtifactRow>> {
        match self.ledger().get_any_artifact(id).await? {
            // As good as published, whatever kept whoever made it from saying so. One that was deleted does not exist.
            Some(_) => Ok(Some(self.ledger().artifact_ready(id, None, clock::now()).await?)),
            None => Ok(None),
        }
    }

    /// Refuses an upload that was begun too long ago.
    pub(super) fn in_time(&self, begun: &PendingUpload) -> Result<()> {
        let longest = self.limits().abandoned_after;
        match clock::now() >= begun.start_time.saturating_add(clock::micros(longest)) {
            true => Err(Error::UploadTooSlow(longest)),
            false => Ok(()),
        }
    }

    /// When bytes that were reserved `now` are given back, if there is no artifact.
    pub(super) fn end_of_reservation(&self, now: i64) -> i64 {
        now.saturating_add(clock::micros(self.limits().abandoned_after + LAST_COPY))
    }

    async fn take(&self, project: &str, id: Uuid, metadata: UploadMetadata) -> Result<ArtifactRow> {
        let announced = upload::announced("upload", &metadata)?;
        if !self.ledger().is_reserved(id).await? {
            self.room_for_bytes(project, announced.size).await?;
        }
        let path = ArtifactPath::taken(Uuid::now_v7(), id);
        let taken = self
            .store()
            .take(&ArtifactPath::staged(id), path.clone(), announced)
            .await;
        let taken = taken.map_err(|error| told(error, announced))?;
        // From here on a row may point at it, whatever becomes of this call; if none does it is collected as an orphan.
        taken.keep();
        self.publish(project, id, metadata, path).await
    }

    /// Makes the artifact of bytes that lie at `path` and are right.
    pub(super) async fn publish(
        &self,
        project: &str,
        id: Uuid,
        metadata: UploadMetadata,
        path: ArtifactPath,
    ) -> Result<ArtifactRow> {
        let new = NewArtifact {
            id,
            display_name: metadata.display_name,
            size: metadata.size_bytes,
            sha256: metadata.sha256,
            origin: Origin::Upload {
                project: project.to_owned(),
            },
            secret: false,
            evidence: false,
            path: path.to_string(),
        };
        if let Err(error) = self.ledger().create_artifact(new, clock::now()).await {
            // Its answer may have been lost, and the same call may have come first.
            let Some(row) = self.ledger().get_any_artifact(id).await? else {
                return Err(error.into());
            };
            if row.path != path.to_string() {
                self.remove_left(&path).await;
            }
        }
        Ok(self.ledger().artifact_ready(id, None, clock::now()).await?)
    }

    async fn remove_staged(&self, id: Uuid) {
        self.remove_left(&ArtifactPath::staged(id)).await;
    }

    /// Removes bytes without a row. What is left of them is collected later if this fails.
    async fn remove_left(&self, path: &ArtifactPath) {
        if let Err(error) = self.store().delete(path).await {
            tracing::warn!(%path, error = %chain(&error), "bytes of an upload are left for later");
        }
    }

    /// A name that opens for callers of the project only.
    pub(crate) fn name_of_upload(
        &self,
        project: &str,
        id: Uuid,
        start_time: i64,
        metadata: UploadMetadata,
        in_parts: bool,
    ) -> Result<String> {
        let begun = PendingUpload {
            id: id.as_bytes().to_vec(),
            start_time,
            metadata,
            in_parts,
        };
        let sealed = self.master().seal(&context(project), &begun.encode_to_vec());
        let sealed = sealed.map_err(|error| Error::internal("naming an upload", error))?;
        Ok(format!("{COLLECTION}{}", URL_SAFE_NO_PAD.encode(sealed)))
    }

    pub(super) fn begun_upload(&self, project: &str, name: &str) -> Result<(Uuid, PendingUpload)> {
        let sealed = name.strip_prefix(COLLECTION).filter(|_| name.len() <= MAX_NAME_BYTES);
        let sealed = sealed.ok_or_else(|| Error::invalid("upload", "must be a name that StartUpload gave"))?;
        let open = || {
            let sealed = URL_SAFE_NO_PAD.decode(sealed).ok()?;
            let begun = self.master().open(&context(project), &sealed).ok()?;
            let begun = PendingUpload::decode(begun.expose_secret()).ok()?;
            Some((Uuid::from_slice(&begun.id).ok()?, begun))
        };
        open().ok_or_else(|| Error::NotFound {
            kind: "upload",
            name: name.to_owned(),
        })
    }
}

fn context(project: &str) -> String {
    format!("an upload of project {project}")
}

/// The store's error, of the one field that there is.
fn told(error: StoreError, announced: Announced) -> Error {
    if let StoreError::Gone { .. } = error {
        let nothing = format!(
            "nothing was sent to its address, and {} bytes were announced",
            announced.size
        );
        return Error::invalid("upload", nothing);
    }
    let mut error = Error::from(error);
    if let Error::Invalid(violations) = &mut error {
        for violation in violations {
            violation.field = "upload".to_owned();
        }
    }
    error
}
