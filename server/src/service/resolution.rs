//! The C2PA's Soft Binding Resolution API, answered from the ledger: of one project, which sidecars there are of a mark.
use guardsplat_soft_binding::resolution::{self, JSON, MANIFEST, Question, Refusal};
use prost::bytes::Bytes;

use crate::artifacts::ArtifactPath;
use crate::error::{Error, Result};
use crate::ledger::CredentialsOf;
use crate::service::Service;

/// Longest sidecar that is given out in one piece. One of a scene has some kilobytes.
const MAX_SIDECAR: usize = 4 << 20;

/// What a question is answered with.
pub(crate) enum Answer {
    /// Media type and body.
    Found(&'static str, Bytes),
    /// Nothing, and why.
    Refused(Refusal),
}

impl Service {
    /// Answers a question about the credentials of a project; of others there are none.
    pub(crate) async fn resolve(&self, project: &str, question: Question) -> Result<Answer> {
        match question {
            Question::Algorithms => json(resolution::algorithms()),
            Question::ByBinding { value: None, .. } => json(resolution::matches([])),
            Question::ByBinding {
                value: Some(value),
                most,
            } => {
                let most = u32::try_from(most).unwrap_or(u32::MAX);
                let of = CredentialsOf::Binding(value.text());
                let found = self.ledger().find_credentials(project, &of, most).await?;
                json(resolution::matches(found.iter().map(|row| row.manifest.as_str())))
            }
            // What workers make has one manifest, so that the active one is all of it.
            Question::Manifest { id, .. } => self.manifest(project, id).await,
        }
    }

    async fn manifest(&self, project: &str, id: String) -> Result<Answer> {
        let of = CredentialsOf::Manifest(id);
        let found = self.ledger().find_credentials(project, &of, 1).await?;
        let Some(row) = found.into_iter().next() else {
            return Ok(Answer::Refused(Refusal::no_manifest()));
        };
        let (bytes, size) = self.store().head(&ArtifactPath::parse(&row.path)?, MAX_SIDECAR).await?;
        if size > MAX_SIDECAR as u64 {
            return Ok(Answer::Refused(Refusal {
                status: 413,
                told: format!("it has {size} bytes; download artifacts/{}", row.artifact),
            }));
        }
        Ok(Answer::Found(MANIFEST, bytes))
    }
}

fn json(bytes: serde_json::Result<Vec<u8>>) -> Result<Answer> {
    let bytes = bytes.map_err(|error| Error::internal("writing an answer", error))?;
    Ok(Answer::Found(JSON, bytes.into()))
}
