//! The end of a job with a claim: what a worker read becomes a verdict, and evidence of it.
use guardsplat_codeword::{Answer, HypothesisReading, ReadPayload, Verdict};
use guardsplat_evidence::{Evidence, View, Worker};
use guardsplat_proto::v1::verify_result::Verdict as ApiVerdict;
use guardsplat_proto::v1::{EmbedResult, FramedReading, SeenView, VerifyResult};

use super::decided::Decided;
use super::{Claim, hypotheses, of_job};
use crate::error::{Error, Result};
use crate::ledger::{Completion, JobKind, JobResult, JobRow, KeyRow};
use crate::service::clock::timestamp;
use crate::service::evidence::{Facts, Files, Read};
use crate::service::lease::needed_key;
use crate::service::names::ResourceKind;
use crate::service::{Service, evidence};

/// What a worker told besides the result.
pub(crate) struct WorkerReadings {
    /// What it read.
    pub readings: Vec<FramedReading>,
    /// What it is.
    pub engine: String,
    /// What it saw.
    pub views: Vec<SeenView>,
}

/// What of that was checked.
struct Checked<'a> {
    told: &'a WorkerReadings,
    readings: Vec<HypothesisReading>,
    views: Vec<View>,
}

impl Service {
    /// Decides the claim of a job, if it has one, and adds the verdict and the evidence to what becomes of it.
    pub(crate) async fn conclude(
        &self,
        job: &JobRow,
        token: &str,
        told: &WorkerReadings,
        completion: &mut Completion,
    ) -> Result<()> {
        let Some(claim) = of_job(job)? else {
            if job.kind() == JobKind::Verify {
                // No claim, but a reading like any other: what it showed may be claimed next.
                self.read_before(job, &self.key_of(job).await?).await?;
            }
            return Ok(());
        };
        let key = self.key_of(job).await?;
        let told = Checked {
            told,
            readings: hypotheses::checked(&told.readings, key.bits)?,
            views: evidence::checked_views(&told.views)?,
        };
        let report = match &mut completion.result {
            JobResult::Embed(result) => self.marked(job, &key, &claim, told, result).await?,
            JobResult::Verify(result) => self.verified(job, &key, &claim, told, result).await?,
            JobResult::CreateKey(_) => return Ok(()),
        };
        let signed = guardsplat_evidence::sign(&report, self.notary().report_key())
            .map_err(|error| Error::internal("writing evidence", error))?;
        let html = self.keep_evidence(job.id, token, "evidence.html", signed.html.into_bytes());
        let html = html.await?;
        let json = self.keep_evidence(job.id, token, "evidence.json", signed.json.into_bytes());
        let json = json.await?;
        completion.outputs.extend([html, json]);
        let [evidence_html, evidence_json] = [html, json].map(|id| ResourceKind::Artifact.name(id));
        match &mut completion.result {
            JobResult::Embed(result) => {
                (result.evidence_html, result.evidence_json) = (evidence_html, evidence_json);
            }
            JobResult::Verify(result) => {
                (result.evidence_html, result.evidence_json) = (evidence_html, evidence_json);
            }
            JobResult::CreateKey(_) => {}
        }
        Ok(())
    }

    async fn key_of(&self, job: &JobRow) -> Result<KeyRow> {
        let id = needed_key(job)?.ok_or_else(|| Error::internal("finding a job's key", "it names none"))?;
        let key = self.ledger().get_key(id).await?;
        key.ok_or_else(|| ResourceKind::Key.not_found(id))
    }

    /// Who has the job, or had it last.
    async fn worker_of(&self, job: &JobRow) -> Result<Option<Worker>> {
        let attempts = self.ledger().attempts(job.id).await?;
        Ok(attempts.into_iter().next().map(|attempt| Worker {
            name: attempt.worker,
            attempt: attempt.number.unsigned_abs(),
        }))
    }

    async fn verified(
        &self,
        job: &JobRow,
        key: &KeyRow,
        claim: &Claim,
        told: Checked<'_>,
        result: &mut VerifyResult,
    ) -> Result<Evidence> {
        let Checked { told, readings, views } = told;
        if readings.is_empty() {
            let reason = "is missing: the server decides a claim on what was read";
            return Err(Error::invalid("readings", reason));
        }
        let before = self.read_before(job, key).await?;
        let original = self.original_of(job).await?;
        let decided = self.decide(claim, key, &readings, Some(before), original).await?;
        *result = answered(std::mem::take(result), &decided, readings.len());
        let facts = Facts {
            job,
            key,
            engine: &told.engine,
            device: &result.device,
            worker: self.worker_of(job).await?,
            views,
        };
        let files = Files::of_suspects(self, job).await?;
        let read = Read {
            decided: &decided,
            framings: hypotheses::kinds(&told.readings, &readings),
        };
        evidence::of_verification(&facts, files, &read)
    }

    async fn marked(
        &self,
        job: &JobRow,
        key: &KeyRow,
        claim: &Claim,
        told: Checked<'_>,
        result: &mut EmbedResult,
    ) -> Result<Evidence> {
        let Checked { told, readings, views } = told;
        // The word that was embedded is as secret as its pad.
        result.message.clear();
        let decided = match readings.is_empty() {
            true => None,
            false => Some(self.decide(claim, key, &readings, None, None).await?),
        };
        let read = decided.as_ref().map(|decided| Read {
            decided,
            framings: hypotheses::kinds(&told.readings, &readings),
        });
        let facts = Facts {
            job,
            key,
            engine: &told.engine,
            device: &result.device,
            worker: self.worker_of(job).await?,
            views,
        };
        let files = Files::of_marking(self, job, result).await?;
        evidence::of_marking(&facts, files, result, read.as_ref())
    }
}

/// The result with what was decided in place of what the worker, who knows of no claim, made of it.
fn answered(read: VerifyResult, decided: &Decided, framings: usize) -> VerifyResult {
    let Answer {
        verdict,
        rate,
        bits,
        needed_rank_sum,
        hypotheses,
        best,
        payload,
        reason,
    } = &decided.tested.answer;
    let matched = decided.best.as_ref().filter(|_| *verdict == Verdict::Match);
    let payload = match payload {
        // What differs from the registry is another codeword that happened to be nearer.
        Some(ReadPayload::Read {
            payload,
            corrected_bits,
            as_registered: true,
            ..
        }) => Some((payload, corrected_bits)),
        _ => None,
    };
    VerifyResult {
        verdict: api_verdict(*verdict).into(),
        p_value: best.as_ref().map(|best| best.p_value),
        threshold: Some(*rate),
        matched_bits: best.as_ref().map(|best| best.matched_bits),
        rank_sum: best.as_ref().map(|best| best.rank_sum),
        needed_rank_sum: *needed_rank_sum,
        bits: *bits,
        views: best.as_ref().map_or(read.views, |best| best.views),
        // Bit by bit only the owner is told.
        message: String::new(),
        bit_accuracy: None,
        bit_accuracy_worst_view: None,
        reason: reason.clone().unwrap_or_default(),
        hypotheses: Some(*hypotheses),
        framings: framings as u32,
        assets: decided.tried.assets,
        assets_paid: decided.tried.assets_paid,
        readings_paid: decided.tried.readings,
        first_seen_time: decided.before.map(|before| timestamp(before.first_seen)),
        asset_commit_time: decided.shown().map(|best| timestamp(best.commitment.commitment.time)),
        asset_registered_later: decided.shown().is_some_and(|best| decided.is_later(best)),
        framing: best.as_ref().map(|best| best.hypothesis.clone()).unwrap_or_default(),
        asset: matched
            .map(|best| ResourceKind::Asset.name(best.asset.id))
            .unwrap_or_default(),
        owner: matched
            .map(|best| ResourceKind::Owner.name(best.owner.id))
            .unwrap_or_default(),
        payload_number: payload.map(|(payload, _)| payload.number.into()),
        corrected_bits: payload.map(|(_, corrected)| *corrected),
        ..read
    }
}

fn api_verdict(verdict: Verdict) -> ApiVerdict {
    match verdict {
        Verdict::Match => ApiVerdict::Match,
        Verdict::NoMatch => ApiVerdict::NoMatch,
        Verdict::Inconclusive => ApiVerdict::Inconclusive,
        Verdict::UnknownKey => ApiVerdict::UnknownKey,
    }
}
