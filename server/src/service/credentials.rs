//! Content credentials of marked scenes: what a worker tells of those that it made, and which there are of a mark that was
//! found.
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{Credentials, EmbedSpec};
use guardsplat_soft_binding::Value;

use crate::error::{Error, Result};
use crate::ledger::{Completion, CredentialsOf, CredentialsRow, JobResult, JobRow, JobSpec, Mark, NewCredentials};
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{Service, claims, lease, message, text};

/// Most that a verification names.
const NAMED: u32 = 10;

/// What a scene is marked with.
fn mark(spec: &EmbedSpec) -> Result<Mark> {
    match claims::of_embed(spec)? {
        Some(claims::Claim::Asset(id)) => Ok(Mark::Asset(id)),
        _ => Ok(Mark::Message(message::canonical(&spec.message))),
    }
}

/// Checks the credentials that came out of a job, which must be there where they were asked for, and nowhere else.
pub fn told(spec: &EmbedSpec, told: Option<&Credentials>) -> Result<Option<NewCredentials>> {
    const FIELD: &str = "embed_result.credentials";
    let told = match (spec.credentials, told) {
        (false, None) => return Ok(None),
        (false, Some(_)) => return Err(Error::invalid(FIELD, "were not asked for")),
        (true, None) => {
            let reason = "is missing: the job asks for content credentials, which this worker does not make";
            return Err(Error::invalid(FIELD, reason));
        }
        (true, Some(told)) => told,
    };
    let mut problems = Violations::default();
    let artifact = ResourceKind::Artifact.parse("embed_result.credentials.artifact", &told.artifact);
    let artifact = problems.take(artifact)?;
    problems.check(
        !told.manifest.is_empty(),
        "embed_result.credentials.manifest",
        "is missing",
    );
    problems.take(text::reason("embed_result.credentials.manifest", &told.manifest))?;
    let value = Value::parse(&told.soft_binding)
        .map_err(|error| Error::invalid("embed_result.credentials.soft_binding", error.to_string()));
    let value = problems.take(value)?;
    problems.finish()?;
    Ok(match (artifact, value) {
        (Some(artifact), Some(value)) => Some(NewCredentials {
            artifact,
            mark: mark(spec)?,
            manifest: told.manifest.clone(),
            soft_binding: value.text(),
            test_certificate: told.test_certificate,
        }),
        _ => None,
    })
}

/// Credentials for the API.
pub fn to_proto(row: CredentialsRow) -> Credentials {
    Credentials {
        artifact: ResourceKind::Artifact.name(row.artifact),
        manifest: row.manifest,
        soft_binding: row.soft_binding,
        test_certificate: row.test_certificate,
        job: ResourceKind::Job.name(row.job),
    }
}

impl Service {
    /// Names the credentials of the mark that a verification found, if it found one.
    pub(crate) async fn name_credentials(&self, job: &JobRow, completion: &mut Completion) -> Result<()> {
        let (JobSpec::Verify(spec), JobResult::Verify(result)) = (&job.spec, &mut completion.result) else {
            return Ok(());
        };
        let Some(key) = lease::needed_key(job)?.filter(|_| result.verdict() == Verdict::Match) else {
            return Ok(());
        };
        let mark = match (result.asset.as_str(), spec.message.as_str()) {
            ("", "") => return Ok(()),
            ("", message) => Mark::Message(message::canonical(message)),
            (asset, _) => Mark::Asset(ResourceKind::Asset.parse("verify_result.asset", asset)?),
        };
        let of = CredentialsOf::Mark(key, mark);
        let found = self.ledger().find_credentials(&job.project, &of, NAMED).await?;
        result.credentials = found.into_iter().map(to_proto).collect();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALUE: &str = "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2";

    #[test]
    fn credentials_are_there_where_they_were_asked_for_and_nowhere_else() {
        let spec = |credentials| EmbedSpec {
            message: "0xC0FFEE42".into(),
            credentials,
            ..EmbedSpec::default()
        };
        let good = Credentials {
            artifact: "artifacts/0190a5d0-0000-7000-8000-00000000000b".into(),
            manifest: "urn:c2pa:1".into(),
            soft_binding: VALUE.into(),
            test_certificate: true,
            job: String::new(),
        };
        assert_eq!(told(&spec(false), None).unwrap(), None);
        let made = told(&spec(true), Some(&good)).unwrap().unwrap();
        assert_eq!(made.mark, Mark::Message("c0ffee42".into()));
        let refused = |asked, said: Option<&Credentials>| match told(&spec(asked), said) {
            Err(Error::Invalid(violations)) => violations.into_iter().map(|v| v.field).collect::<Vec<_>>(),
            other => panic!("{other:?}"),
        };
        assert_eq!(refused(false, Some(&good)), ["embed_result.credentials"]);
        assert_eq!(refused(true, None), ["embed_result.credentials"]);
        let bad = Credentials {
            manifest: "a\nb".into(),
            soft_binding: "c0ffee42".into(),
            artifact: "jobs/1".into(),
            ..good
        };
        assert_eq!(
            refused(true, Some(&bad)),
            ["artifact", "manifest", "soft_binding"].map(|field| format!("embed_result.credentials.{field}"))
        );
    }
}
