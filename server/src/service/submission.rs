//! Checks a `CreateJob` request, all of it, before anything is queued.
use std::collections::HashSet;

use guardsplat_codeword::MessageLength;
use guardsplat_proto::v1::embed_spec::{Distortion, Preset, SceneKind};
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{CreateJobRequest, EmbedSpec, Job, KeySpec, VerifySpec};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::ledger::queue::PRIORITIES;
use crate::ledger::{ArtifactId, JobSpec, KeyId, KeyOrder, Seed};
use crate::service::claims::{self, Claim};
use crate::service::names::ResourceKind;
use crate::service::other_files::{self, OtherFile};
use crate::service::violations::Violations;
use crate::service::{fingerprint, text};

/// Most suspects of one job.
pub const MAX_SUSPECTS: usize = 1000;
const MAX_VIEWS: u32 = 10_000;
const SIDES: std::ops::RangeInclusive<u32> = 16..=4096;

/// A request that holds, as far as that can be said without the ledger.
#[derive(Debug)]
pub struct Submission {
    /// What people call the job.
    pub display_name: String,
    /// What it does.
    pub spec: JobSpec,
    /// Artifacts it reads: the scene or the suspects, and then its [`other_files`], where there are any.
    pub inputs: Vec<ArtifactId>,
    /// The key it needs, and the field that named it.
    pub key: Option<KeyId>,
    /// A message that has to fit the key, and the field it was given in.
    pub message: Option<(&'static str, String)>,
    /// Whose mark it writes or looks for.
    pub claim: Option<Claim>,
    /// How urgent it is, where that was said.
    pub priority: Option<i32>,
    /// Names the request.
    pub request_id: Option<Uuid>,
    /// SHA-256 of what was asked for, but for the artifacts, which [`fingerprint::whole`] adds.
    pub asked: [u8; 32],
}

/// Checks a request.
pub fn check(request: CreateJobRequest) -> Result<Submission> {
    let CreateJobRequest { job, request_id } = request;
    let Some(job) = job else {
        return Err(Error::invalid("job", "is missing"));
    };
    let mut problems = Violations::default();
    let request_id = problems.take(self::request_id(&request_id))?.flatten();
    problems.take(text::display_name("job.display_name", &job.display_name))?;
    output_only(&job, &mut problems);
    problems.check(
        job.priority.is_none_or(|priority| PRIORITIES.contains(&priority)),
        "job.priority",
        "must be -10 to 10",
    );
    let asked = fingerprint::asked(&job);
    let checked = match job.spec {
        Some(Spec::Embed(spec)) => embed(&spec, &mut problems)?.map(|w| (JobSpec::Embed(spec), w)),
        Some(Spec::Verify(spec)) => verify(&spec, &mut problems)?.map(|w| (JobSpec::Verify(spec), w)),
        Some(Spec::CreateKey(spec)) => {
            create_key(&spec, &mut problems);
            let order = KeyOrder {
                bits: spec.bits,
                seed: spec.seed.map(Seed::Open),
            };
            Some((JobSpec::CreateKey(order), Wanted::default()))
        }
        None => {
            problems.add(
                "job.spec",
                "is missing, one of embed, verify and create_key must be set",
            );
            None
        }
    };
    problems.finish()?;
    let (spec, wanted) = checked.ok_or_else(|| Error::invalid("job.spec", "names something that is invalid"))?;
    let Wanted {
        inputs,
        key,
        message,
        claim,
    } = wanted;
    Ok(Submission {
        display_name: job.display_name,
        spec,
        inputs,
        key,
        message,
        claim,
        priority: job.priority,
        request_id,
        asked,
    })
}

/// What a job needs that the ledger has to have.
#[derive(Default)]
struct Wanted {
    inputs: Vec<ArtifactId>,
    key: Option<KeyId>,
    message: Option<(&'static str, String)>,
    claim: Option<Claim>,
}

fn embed(spec: &EmbedSpec, problems: &mut Violations) -> Result<Option<Wanted>> {
    let scene = problems.take(ResourceKind::Artifact.parse("job.embed.scene", &spec.scene))?;
    let key = problems.take(ResourceKind::Key.parse("job.embed.key", &spec.key))?;
    let claim = problems.take(claims::of_embed(spec))?.flatten();
    problems.check(
        !spec.message.is_empty() || !spec.asset.is_empty(),
        "job.embed.message",
        "is missing, one of message and asset must be set",
    );
    problems.check(
        spec.message.is_empty() || spec.asset.is_empty(),
        "job.embed.message",
        "must be empty where an asset is given, which has a message of its own",
    );
    problems.check(
        Preset::try_from(spec.preset).is_ok(),
        "job.embed.preset",
        "is no preset that this server knows",
    );
    distortions(&spec.robust_to, problems);
    side("job.embed.size", spec.size, problems);
    let message = (!spec.message.is_empty()).then(|| ("job.embed.message", spec.message.clone()));
    scene_kind("job.embed.scene_kind", spec.scene_kind, &spec.cameras, problems);
    let others = others(other_files::of_embed(spec), problems)?;
    Ok(scene.map(|scene| Wanted {
        inputs: std::iter::once(scene).chain(others).collect(),
        key,
        message,
        claim,
    }))
}

fn distortions(robust_to: &[i32], problems: &mut Violations) {
    const FIELD: &str = "job.embed.robust_to";
    let mut seen = HashSet::new();
    for (i, number) in robust_to.iter().enumerate() {
        let field = format!("{FIELD}[{i}]");
        if !Distortion::try_from(*number).is_ok_and(|known| known != Distortion::Unspecified) {
            return problems.add(field, "is no distortion that this server knows");
        }
        if !seen.insert(number) {
            return problems.add(field, "is named twice");
        }
    }
}

fn verify(spec: &VerifySpec, problems: &mut Violations) -> Result<Option<Wanted>> {
    const SUSPECTS: &str = "job.verify.suspects";
    let count = spec.suspects.len();
    if count > MAX_SUSPECTS {
        // Not looked at one by one: the list may be as long as a message can be.
        problems.add(
            SUSPECTS,
            format!("has {count} entries, at most {MAX_SUSPECTS} are taken"),
        );
        return Ok(None);
    }
    problems.check(count > 0, SUSPECTS, "is empty, a scene or pictures must be named");
    let (mut inputs, mut seen) = (Vec::with_capacity(count), HashSet::new());
    for (i, name) in spec.suspects.iter().enumerate() {
        let field = format!("{SUSPECTS}[{i}]");
        let Some(id) = problems.take(ResourceKind::Artifact.parse(&field, name))? else {
            continue;
        };
        if !seen.insert(id) {
            problems.add(field, "is named twice, and a picture counts once");
        }
        inputs.push(id);
    }
    let key = problems.take(ResourceKind::Key.parse("job.verify.key", &spec.key))?;
    problems.check(
        spec.views <= MAX_VIEWS,
        "job.verify.views",
        "must be 1 to 10000, or 0 for 20",
    );
    side("job.verify.size", spec.size, problems);
    scene_kind("job.verify.scene_kind", spec.scene_kind, &spec.cameras, problems);
    inputs.extend(others(other_files::of_verify(spec), problems)?);
    let claim = problems.take(claims::of_verify(spec))?.flatten();
    let message = (!spec.message.is_empty()).then(|| ("job.verify.message", spec.message.clone()));
    Ok(Some(Wanted {
        inputs,
        key,
        message,
        claim,
    }))
}

/// A kind of scene, which has a say only where there are no cameras.
fn scene_kind(field: &str, number: i32, cameras: &str, problems: &mut Violations) {
    let known = SceneKind::try_from(number);
    problems.check(known.is_ok(), field, "is no kind of scene that this server knows");
    problems.check(
        cameras.is_empty() || number == 0,
        field,
        "must be left out where cameras are given, which say where viewers are",
    );
}

/// Cameras and the like, where they are named.
fn others(files: Vec<OtherFile<'_>>, problems: &mut Violations) -> Result<Vec<ArtifactId>> {
    let mut found = Vec::with_capacity(files.len());
    for OtherFile { field, name, .. } in files {
        found.extend(problems.take(ResourceKind::Artifact.parse(field, name))?);
    }
    Ok(found)
}

fn create_key(spec: &KeySpec, problems: &mut Violations) {
    problems.check(
        MessageLength::try_from(spec.bits).is_ok(),
        "job.create_key.bits",
        "must be 1 to 150",
    );
    let reason = "is set by the server and must be empty";
    problems.check(!spec.seeded, "job.create_key.seeded", reason);
}

fn side(field: &str, size: u32, problems: &mut Violations) {
    problems.check(
        size == 0 || SIDES.contains(&size),
        field,
        "must be 16 to 4096 pixels, or 0 for the default",
    );
}

/// The server alone writes these.
fn output_only(job: &Job, problems: &mut Violations) {
    let empty = [
        ("name", job.name.is_empty()),
        ("state", job.state == 0),
        ("cancel_requested", !job.cancel_requested),
        ("attempt", job.attempt == 0),
        ("max_attempts", job.max_attempts == 0),
        ("queue_position", job.queue_position.is_none()),
        ("progress", job.progress.is_none()),
        ("result", job.result.is_none()),
        ("failure", job.failure.is_none()),
        ("create_time", job.create_time.is_none()),
        ("update_time", job.update_time.is_none()),
        ("start_time", job.start_time.is_none()),
        ("end_time", job.end_time.is_none()),
        ("retry_time", job.retry_time.is_none()),
        ("waiting_reason", job.waiting_reason.is_empty()),
    ];
    for (field, _) in empty.iter().filter(|(_, empty)| !empty) {
        problems.add(format!("job.{field}"), "is set by the server and must be empty");
    }
}

/// The id that names a request; none when it is empty.
pub fn request_id(text: &str) -> Result<Option<Uuid>> {
    if text.is_empty() {
        return Ok(None);
    }
    let id = Uuid::try_parse(text).ok().filter(|id| !id.is_nil());
    id.map(Some)
        .ok_or_else(|| Error::invalid("request_id", "must be a UUID that is not all zeros"))
}
