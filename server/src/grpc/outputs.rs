//! `UploadOutput`: what an attempt makes, stored under its lease and seen by nobody before the job is complete.
use guardsplat_proto::v1::UploadOutputRequest;
use secrecy::SecretSlice;
use secrecy::zeroize::Zeroizing;
use tonic::Status;
use uuid::Uuid;

use crate::artifacts::{Announced, ArtifactPath, Check};
use crate::error::{Error, Result};
use crate::grpc::upload_stream::Incoming;
use crate::ledger::{ArtifactRow, JobKind, NewArtifact, Origin};
use crate::service::names::ResourceKind;
use crate::service::{Service, clock, upload};

/// Most bytes of a key file. One of 150 bits has less than 3 MiB.
const MAX_KEY_BYTES: u64 = 4 << 20;

impl Service {
    /// Takes an output. Its bytes lie in a folder of the attempt's own.
    pub(crate) async fn receive_output(
        &self,
        mut incoming: Incoming<UploadOutputRequest>,
    ) -> Result<ArtifactRow, Status> {
        let metadata = incoming.metadata().await?;
        let job = ResourceKind::Job.parse("metadata.job", &metadata.job)?;
        let upload = metadata
            .upload
            .ok_or_else(|| Error::invalid("metadata.upload", "is missing"))?;
        let announced = upload::announced("metadata.upload", &upload)?;
        let token = metadata.lease_token;
        let leased = self.ledger().leased_job(job, &token).await.map_err(Error::from)?;
        if metadata.secret && leased.kind() != JobKind::CreateKey {
            return Err(Error::invalid("metadata.secret", "only jobs that make a key have secret outputs").into());
        }
        let id = Uuid::now_v7();
        let path = ArtifactPath::output(job, &token, id);
        let new = NewArtifact {
            id,
            display_name: upload.display_name,
            size: upload.size_bytes,
            sha256: upload.sha256,
            origin: Origin::Output {
                job,
                token: token.clone(),
            },
            secret: metadata.secret,
            evidence: false,
            path: path.to_string(),
        };
        if metadata.secret {
            let check = Check::new(announced, MAX_KEY_BYTES).map_err(output_error)?;
            self.ledger()
                .create_artifact(new, clock::now())
                .await
                .map_err(Error::from)?;
            let secret = receive_secret(incoming, check).await?;
            self.store()
                .write_sealed(&path, self.master(), &secret)
                .await
                .map_err(Error::from)?;
        } else {
            self.receive_file(incoming, &path, announced, new).await?;
        }
        let ready = self.ledger().artifact_ready(id, Some(&token), clock::now()).await;
        Ok(ready.map_err(Error::from)?)
    }

    async fn receive_file(
        &self,
        mut incoming: Incoming<UploadOutputRequest>,
        path: &ArtifactPath,
        announced: Announced,
        new: NewArtifact,
    ) -> Result<(), Status> {
        let mut writer = self.store().write(path, announced).await.map_err(output_error)?;
        self.ledger()
            .create_artifact(new, clock::now())
            .await
            .map_err(Error::from)?;
        while let Some(chunk) = incoming.chunk().await? {
            writer.chunk(chunk).await.map_err(output_error)?;
        }
        writer.finish().await.map_err(output_error)?;
        Ok(())
    }
}

/// A key file, whole, so that it is on no disk before it is sealed.
async fn receive_secret(
    mut incoming: Incoming<UploadOutputRequest>,
    mut check: Check,
) -> Result<SecretSlice<u8>, Status> {
    // Room for all of it at once: a buffer that grows would leave copies behind.
    let mut bytes = Zeroizing::new(Vec::with_capacity(MAX_KEY_BYTES as usize));
    while let Some(chunk) = incoming.chunk().await? {
        let chunk = Zeroizing::new(chunk);
        check.chunk(&chunk).map_err(output_error)?;
        bytes.extend_from_slice(&chunk);
    }
    check.finish().map_err(output_error)?;
    // A boxed copy of the exact length; the buffer is wiped when it is dropped.
    Ok(SecretSlice::from(bytes.to_vec()))
}

/// The store tells of fields as `UploadArtifact` has them; here they are one level deeper.
fn output_error(error: crate::artifacts::StoreError) -> Error {
    let mut error = Error::from(error);
    if let Error::Invalid(violations) = &mut error {
        for violation in violations {
            if let Some(rest) = violation.field.strip_prefix("metadata.") {
                violation.field = format!("metadata.upload.{rest}");
            }
        }
    }
    error
}
