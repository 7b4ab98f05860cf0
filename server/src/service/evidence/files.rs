//! The files that a report is about, and the files that it becomes.
use guardsplat_evidence::{Input, Role};
use guardsplat_proto::v1::EmbedResult;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::hash;
use crate::artifacts::{Announced, ArtifactPath, CHUNK_BYTES};
use crate::error::{Error, Result};
use crate::ledger::{ArtifactId, JobId, JobRow, JobSpec, NewArtifact, Origin};
use crate::service::names::ResourceKind;
use crate::service::other_files::{self, OtherFile};
use crate::service::{Service, clock};

/// Files with what they are for.
pub struct Files {
    /// In the order of the job.
    pub inputs: Vec<Input>,
}

impl Files {
    /// What a `verify` job read.
    pub async fn of_suspects(api: &Service, job: &JobRow) -> Result<Self> {
        let JobSpec::Verify(spec) = &job.spec else {
            return Err(Error::internal("listing what was read", "the job is no verification"));
        };
        let mut inputs = Vec::with_capacity(spec.suspects.len());
        for name in &spec.suspects {
            inputs.push(input(api, "job.verify.suspects", name, Role::Suspect).await?);
        }
        inputs.extend(others(api, other_files::of_verify(spec)).await?);
        Ok(Self { inputs })
    }

    /// What an `embed` job read and made.
    pub async fn of_marking(api: &Service, job: &JobRow, result: &EmbedResult) -> Result<Self> {
        let JobSpec::Embed(spec) = &job.spec else {
            return Err(Error::internal("listing what was marked", "the job marks nothing"));
        };
        let original = input(api, "job.embed.scene", &spec.scene, Role::Original).await?;
        let marked = input(api, "embed_result.scene", &result.scene, Role::Marked).await?;
        let others = others(api, other_files::of_embed(spec)).await?;
        Ok(Self {
            inputs: [original, marked].into_iter().chain(others).collect(),
        })
    }
}

async fn others(api: &Service, files: Vec<OtherFile<'_>>) -> Result<Vec<Input>> {
    let mut inputs = Vec::with_capacity(files.len());
    for OtherFile { field, name, role } in files {
        inputs.push(input(api, field, name, role).await?);
    }
    Ok(inputs)
}

async fn input(api: &Service, field: &str, name: &str, role: Role) -> Result<Input> {
    let id = ResourceKind::Artifact.parse(field, name)?;
    let row = api.ledger().get_any_artifact(id).await?;
    let row = row.ok_or_else(|| ResourceKind::Artifact.not_found(id))?;
    Ok(Input {
        role,
        name: Some(row.display_name).filter(|name| !name.is_empty()),
        bytes: u64::try_from(row.size).unwrap_or_default(),
        sha256: hash(&row.sha256)?,
    })
}

impl Service {
    /// Stores evidence, which the server itself adds to the outputs of an attempt, under its lease.
    pub(crate) async fn keep_evidence(
        &self,
        job: JobId,
        token: &str,
        name: &str,
        bytes: Vec<u8>,
    ) -> Result<ArtifactId> {
        let id = Uuid::now_v7();
        let path = ArtifactPath::output(job, token, id);
        let announced = Announced {
            size: bytes.len() as u64,
            sha256: Sha256::digest(&bytes).into(),
        };
        let new = NewArtifact {
            id,
            display_name: name.to_owned(),
            size: bytes.len() as i64,
            sha256: hex::encode(announced.sha256),
            origin: Origin::Output {
                job,
                token: token.to_owned(),
            },
            secret: false,
            evidence: true,
            path: path.to_string(),
        };
        self.ledger().create_artifact(new, clock::now()).await?;
        let mut writer = self.store().write(&path, announced).await?;
        for chunk in bytes.chunks(CHUNK_BYTES) {
            writer.chunk(chunk.to_vec()).await?;
        }
        writer.finish().await?;
        self.ledger().artifact_ready(id, Some(token), clock::now()).await?;
        Ok(id)
    }
}
