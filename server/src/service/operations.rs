//! For those who look after jobs: which failed, what their attempts came to, and another try.
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::{Job, JobAttempt};

use crate::error::{Error, Result};
use crate::ledger::{ArtifactId, AttemptRow, FailureReason, JobRow, JobSpec, JobState};
use crate::service::clock::timestamp;
use crate::service::names::ResourceKind;
use crate::service::{Service, clock, keys, lease, other_files, to_proto};

impl Service {
    /// Queues a job that failed once more, if it could be carried out.
    pub(crate) async fn requeue(&self, project: &str, name: &str) -> Result<Job> {
        let id = ResourceKind::Job.parse("name", name)?;
        let job = self.owned_job(project, id).await?;
        if job.state != JobState::Failed {
            return Err(Error::NotFailed { name: name.to_owned() });
        }
        if let Some(key) = lease::needed_key(&job)? {
            keys::usable(&self.owned_key(project, key).await?, job.kind())?;
        }
        self.room_in_queue().await?;
        self.room_for_job(project, job.kind()).await?;
        let row = self.ledger().requeue(id, &inputs(&job)?, clock::now()).await?;
        tracing::info!(job = %id, "queued once more");
        self.metrics().requeued(job.kind());
        self.changes().job(id);
        self.changes().queue_grew();
        // Only admins queue jobs once more.
        Ok(to_proto::job(row))
    }

    /// The attempts of a job, newest first.
    pub(crate) async fn attempts(&self, project: &str, name: &str) -> Result<Vec<JobAttempt>> {
        let id = ResourceKind::Job.parse("name", name)?;
        self.owned_job(project, id).await?;
        let rows = self.ledger().attempts(id).await?;
        Ok(rows.into_iter().map(attempt).collect())
    }
}

/// What a job reads.
fn inputs(job: &JobRow) -> Result<Vec<ArtifactId>> {
    let (names, others) = match &job.spec {
        JobSpec::Embed(spec) => (std::slice::from_ref(&spec.scene), other_files::of_embed(spec)),
        JobSpec::Verify(spec) => (&spec.suspects[..], other_files::of_verify(spec)),
        JobSpec::CreateKey(_) => (&[][..], Vec::new()),
    };
    names
        .iter()
        .map(String::as_str)
        .chain(others.iter().map(|other| other.name))
        .map(|name| ResourceKind::Artifact.parse("name", name))
        .collect()
}

/// Reasons that a list is asked for, each once and in order.
pub(crate) fn reasons(given: &[i32], states: &[JobState]) -> Result<Vec<FailureReason>> {
    let mut wanted = Vec::new();
    for (i, &number) in given.iter().enumerate() {
        let known = Reason::try_from(number).is_ok_and(|reason| reason != Reason::Unspecified);
        if !known {
            let problem = format!("{number} is no reason of a failure");
            return Err(Error::invalid(format!("reasons[{i}]"), problem));
        }
        let reason = FailureReason::from_number(number);
        if !wanted.contains(&reason) {
            wanted.push(reason);
        }
    }
    if !wanted.is_empty() && states.iter().any(|&state| state != JobState::Failed) {
        return Err(Error::invalid(
            "states",
            "must be empty or STATE_FAILED alone where reasons are asked for",
        ));
    }
    wanted.sort_unstable();
    Ok(wanted)
}

fn attempt(row: AttemptRow) -> JobAttempt {
    JobAttempt {
        number: row.number,
        worker: row.worker,
        start_time: Some(timestamp(row.start_time)),
        end_time: row.end_time.map(timestamp),
        // Numbers are those of the API.
        outcome: row.outcome as i32,
        failure: row.failure.map(to_proto::failure),
    }
}

#[cfg(test)]
mod tests {
    use guardsplat_proto::v1::job_attempt::Outcome as Theirs;

    use super::*;
    use crate::ledger::Outcome;

    #[test]
    fn numbers_are_those_of_the_api() {
        for (ours, theirs) in [
            (Outcome::UnderWay, Theirs::Unspecified),
            (Outcome::Succeeded, Theirs::Succeeded),
            (Outcome::Failed, Theirs::Failed),
            (Outcome::Cancelled, Theirs::Cancelled),
            (Outcome::Released, Theirs::Released),
        ] {
            assert_eq!(ours as i32, theirs as i32);
        }
    }

    #[test]
    fn reasons_are_known_and_of_failed_jobs() {
        assert_eq!(
            reasons(&[5, 1, 5], &[JobState::Failed]).unwrap(),
            [FailureReason::InvalidInput, FailureReason::AttemptsExhausted]
        );
        assert!(reasons(&[], &[JobState::Queued]).unwrap().is_empty());
        for (given, states, field) in [
            (&[0][..], &[][..], "reasons[0]"),
            (&[1, 6], &[], "reasons[1]"),
            (&[1], &[JobState::Failed, JobState::Queued], "states"),
        ] {
            let Err(Error::Invalid(violations)) = reasons(given, states) else {
                panic!("was taken")
            };
            assert_eq!(violations[0].field, field);
        }
    }
}
