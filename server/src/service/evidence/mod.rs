//! The evidence that a job with a claim leaves: what the server knows of it, as a report to be signed.
mod files;
mod reading;
mod views;

use guardsplat_evidence::{
    Audience, Embedding, Evidence, EvidenceKind as Of, Key, Model, SCHEMA, Sha256, Target, Timestamp, VERSION, View,
    Worker,
};
use guardsplat_proto::v1::EmbedResult;

use crate::error::{Error, Result};
use crate::ledger::{JobRow, KeyRow};
use crate::marks::{self, CODE};
use crate::service::claims::Decided;
use crate::service::names::ResourceKind;
use crate::service::{clock, text, upload};
pub(crate) use files::Files;
pub(crate) use reading::Read;
pub(crate) use views::checked as checked_views;

/// Most bytes of a text that a worker wrote.
const MAX_TEXT_BYTES: usize = 200;

/// Who did what with which key.
pub(crate) struct Facts<'a> {
    /// The job.
    pub job: &'a JobRow,
    /// Its key.
    pub key: &'a KeyRow,
    /// What computed, as it says of itself.
    pub engine: &'a str,
    /// On what it did.
    pub device: &'a str,
    /// Who had the job.
    pub worker: Option<Worker>,
    /// Pictures of what was read.
    pub views: Vec<View>,
}

/// The evidence of a claim on a suspect.
pub(crate) fn of_verification(facts: &Facts<'_>, files: Files, read: &Read<'_>) -> Result<Evidence> {
    Ok(Evidence {
        verification: Some(read.verification(facts.key)?),
        ..facts.evidence(Of::Verify, files)?
    })
}

/// The evidence of a marking, and of its mark being read back if it was.
pub(crate) fn of_marking(
    facts: &Facts<'_>,
    files: Files,
    result: &EmbedResult,
    read: Option<&Read<'_>>,
) -> Result<Evidence> {
    let best = read.and_then(|read| read.decided.best.as_ref());
    let payload = best.map(|best| payload(facts.key, best.asset.payload)).transpose()?;
    let embedding = Embedding {
        payload,
        bit_accuracy: result.bit_accuracy,
        bit_accuracy_worst_view: result.bit_accuracy_worst_view,
        psnr_db: result.psnr_db,
        ssim: result.ssim,
        lpips: result.lpips,
        // The preset has it, which only workers know.
        target: Target::default(),
        missed: result.target_missed.clone(),
        gaussians: result.gaussians,
        changed_gaussians: result.changed_gaussians,
    };
    Ok(Evidence {
        embedding: Some(embedding),
        verification: read.map(|read| read.verification(facts.key)).transpose()?,
        ..facts.evidence(Of::Embed, files)?
    })
}

impl Facts<'_> {
    fn evidence(&self, kind: Of, files: Files) -> Result<Evidence> {
        let started = self.job.start_time.unwrap_or(self.job.create_time);
        Ok(Evidence {
            schema: SCHEMA.into(),
            version: VERSION,
            audience: Audience::Owner,
            kind,
            job: ResourceKind::Job.name(self.job.id),
            started: timestamp(started)?,
            // A clock that was set back can't make it end before it began.
            finished: timestamp(clock::now().max(started))?,
            engine: told(self.engine),
            device: told(self.device),
            worker: self.worker.clone(),
            model: Model {
                name: told(&self.key.clip),
                sha256: hash(&self.key.clip_sha256)?,
            },
            key: Key {
                id: ResourceKind::Key.name(self.key.id),
            },
            inputs: files.inputs,
            verification: None,
            embedding: None,
            views: self.views.clone(),
        })
    }
}

/// The payload of a number of a key, in hexadecimal.
fn payload(key: &KeyRow, number: i64) -> Result<String> {
    let packed = marks::payload(key.id, number)?.pack(CODE);
    let packed = packed.map_err(|error| Error::internal("writing evidence", error))?;
    let digits = CODE.information_bits().div_ceil(4) as usize;
    Ok(format!("{packed:0digits$x}"))
}

/// What a worker says of itself; it may say nothing.
fn told(given: &str) -> String {
    match given {
        "" => "not told".into(),
        given => text::shortened(given.to_owned(), MAX_TEXT_BYTES),
    }
}

fn timestamp(micros: i64) -> Result<Timestamp> {
    Timestamp::from_microsecond(micros).map_err(|error| Error::internal("writing evidence", error))
}

/// A hash that the ledger keeps.
fn hash(digits: &str) -> Result<Sha256> {
    let bytes = upload::digest(digits).map(Sha256);
    bytes.ok_or_else(|| Error::internal("reading a hash kept in the ledger", "it is no SHA-256"))
}
