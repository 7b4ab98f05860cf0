//! `embed`: bytes arrive, figures are told, and files are whole or not there.
use guardsplat_proto::v1::embed_spec::{Distortion, Preset};
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::{Result as Outcome, Spec, State};
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{EmbedSpec, Job, Progress};
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

use super::fake::{KEY, failure, figures, job, send, success};
use super::run::{PICTURE, TestEnvironment};

const LINE: &str = "embed in.ply -o out.ply --key website --message C0FFEE42";

/// More than two chunks, and no multiple of one.
fn scene() -> Vec<u8> {
    let body = (0..600_001u32).map(|i| (i % 251) as u8);
    b"ply\n".iter().copied().chain(body).collect()
}

fn spec_of(environment: &TestEnvironment) -> EmbedSpec {
    match environment
        .fake
        .state()
        .created
        .last()
        .unwrap()
        .job
        .as_ref()
        .unwrap()
        .spec
        .clone()
    {
        Some(Spec::Embed(spec)) => spec,
        other => panic!("{other:?}"),
    }
}

/// A environment with a scene to mark, whose job will end like this with a marked scene.
fn environment(missed: &[&str]) -> TestEnvironment {
    let environment = TestEnvironment::new();
    environment.file("in.ply", &scene());
    let marked = environment.fake.store("marked.ply", &[7; 300_000]);
    let comparison = environment.fake.store("comparison.png", b"png");
    let mut result = figures(&marked, &comparison);
    result.target_missed = missed.iter().map(|&text| text.to_owned()).collect();
    let mut progress = Progress {
        done: 3,
        total: 600,
        bit_accuracy: Some(0.75),
        psnr_db: Some(38.25),
        ..Progress::default()
    };
    progress.set_stage(Stage::Optimising);
    let queued = Job {
        queue_position: Some(2),
        waiting_reason: "nobody is large enough".into(),
        ..job(State::Queued)
    };
    let running = Job {
        progress: Some(progress),
        ..job(State::Running)
    };
    environment
        .fake
        .plan([send(queued), send(running), success(Outcome::EmbedResult(result))]);
    environment
}

#[test]
fn a_scene_goes_there_and_comes_back_marked() {
    let environment = environment(&[]);
    let ran = environment.run(&format!(
        "{LINE} --preset draft --robust-to jpeg,8bit --seed 9 --size 128 --priority -2 --ignore-bad-rows --comparison c.png --json"
    ));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(std::fs::read(environment.path("out.ply")).unwrap(), [7; 300_000]);
    assert_eq!(std::fs::read(environment.path("c.png")).unwrap(), b"png");
    assert_eq!(environment.files(), ["c.png", "in.ply", "out.ply"]);

    let json = ran.json();
    for (field, value) in [
        ("bits", 32.0),
        ("bit_accuracy", 0.975),
        ("bit_accuracy_worst_view", 0.9375),
    ] {
        assert_eq!(json[field], serde_json::json!(value).as_f64().unwrap(), "{field}");
    }
    assert_eq!(json["message"], "c0ffee42");
    assert_eq!(json["message_recovered"], true);
    assert_eq!((&json["psnr_db"], &json["identical"]), (&36.5.into(), &false.into()));
    assert_eq!((&json["steps"], &json["view_steps"]), (&600.into(), &4800.into()));
    assert_eq!(
        (&json["seconds"], &json["device"], &json["clip"]),
        (&12.5.into(), &"cpu".into(), &"guardsplat".into())
    );
    assert_eq!(
        (&json["preset"], &json["seed"], &json["key"]),
        (&"draft".into(), &9.into(), &KEY.into())
    );
    assert_eq!((&json["written"], &json["output"]), (&true.into(), &"out.ply".into()));
    assert!(json["lpips"].is_null() && json["failure"].is_null());
    assert_eq!(json["target_missed"], serde_json::json!([]));

    let spec = spec_of(&environment);
    let state = environment.fake.state();
    let (artifact, bytes) = &state.artifacts[&spec.scene];
    assert_eq!((bytes, artifact.display_name.as_str()), (&scene(), "in.ply"));
    assert_eq!(state.chunks, [262_144, 262_144, 75_717]);
    assert_eq!((spec.key.as_str(), spec.message.as_str()), (KEY, "c0ffee42"));
    assert_eq!(
        (spec.preset(), spec.seed, spec.size, spec.force),
        (Preset::Draft, 9, 128, false)
    );
    assert_eq!(
        spec.robust_to().collect::<Vec<_>>(),
        [Distortion::Jpeg, Distortion::EightBit]
    );
    assert!(spec.ignore_bad_rows && json["ignored_rows"] == 2);
    let request = state.created.last().unwrap();
    let sent = request.job.as_ref().unwrap();
    assert_eq!((sent.display_name.as_str(), sent.priority), ("in.ply", Some(-2)));
    assert!(uuid::Uuid::try_parse(&request.request_id).is_ok());
}

#[test]
fn progress_goes_to_standard_error_as_lines() {
    let ran = environment(&[]).run(LINE);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let expected = "bits 97.50 % (worst view 93.75 %), message c0ffee42 recovered, PSNR 36.50 dB, SSIM 0.9700; 600 \
                    steps, 12 s on cpu\n2 rows ignored\nwritten to out.ply\n";
    assert_eq!(ran.out, expected);
    for line in [
        "upload 600005/600005 bytes",
        "it waits: nobody is large enough",
        "queued 2 jobs before it",
        "marking 3/600 bits 75.0 %, PSNR 38.2 dB",
        "download 300000/300000 bytes",
    ] {
        assert!(ran.err.lines().any(|found| found == line), "{line}:\n{}", ran.err);
    }
    assert!(!ran.err.contains('\u{1b}') && !ran.err.contains('\r'), "{}", ran.err);
}

#[cfg(unix)]
#[test]
fn the_scene_is_as_readable_as_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let environment = environment(&[]);
    assert_eq!(environment.run(LINE).code, 0);
    let mode = |name| std::fs::metadata(environment.path(name)).unwrap().permissions().mode();
    assert_eq!(mode("out.ply"), mode("in.ply"));
}

#[test]
fn a_missed_target_writes_nothing_and_exits_with_3() {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    environment
        .fake
        .plan([failure(Reason::TargetMissed, "bits 91.0 % of 97.0 %")]);
    let ran = environment.run(&format!("{LINE} --json"));
    assert_eq!(ran.code, 3, "{}", ran.err);
    assert_eq!(environment.files(), ["in.ply"]);
    let json = ran.json();
    assert_eq!(json["written"], false);
    assert_eq!(json["target_missed"], serde_json::json!(["bits 91.0 % of 97.0 %"]));
    assert_eq!(json["failure"]["reason"], "target_missed");
    assert!(ran.err.contains("nothing was written"), "{}", ran.err);
}

#[test]
fn a_forced_scene_is_written_and_exits_with_3() {
    let environment = environment(&["PSNR 33.0 dB of 36.0 dB"]);
    let ran = environment.run(&format!("{LINE} --force --json"));
    assert_eq!(ran.code, 3, "{}", ran.err);
    assert!(environment.path("out.ply").is_file());
    assert!(spec_of(&environment).force);
    assert_eq!(
        ran.json()["target_missed"],
        serde_json::json!(["PSNR 33.0 dB of 36.0 dB"])
    );
}

#[test]
fn a_failed_job_is_an_error_with_its_reason() {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    environment
        .fake
        .plan([failure(Reason::InvalidInput, "row 7: opacity is not a number")]);
    let ran = environment.run(&format!("{LINE} --json"));
    assert_eq!(ran.code, 1);
    let error = &ran.json()["error"];
    assert_eq!(error["reason"], "invalid_input");
    assert_eq!(error["message"], "row 7: opacity is not a number");
    assert!(error["job"].as_str().unwrap().starts_with("jobs/"));
    assert!(
        ran.err.contains("row 7: opacity is not a number (invalid_input)"),
        "{}",
        ran.err
    );
    assert_eq!(environment.files(), ["in.ply"]);
}

#[test]
fn without_waiting_the_job_is_printed() {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    let id = "5f0c54a6-6b0d-4d6f-9a80-6a7a0b1f4f11";
    let line = format!("embed in.ply --key {KEY} --message c0ffee42 --no-wait --request-id {id} --json");
    let ran = environment.run(&line);
    assert_eq!(ran.code, 0, "{}", ran.err);
    let json = ran.json();
    assert_eq!((&json["state"], &json["kind"]), (&"queued".into(), &"embed".into()));
    assert_eq!(environment.fake.state().created[0].request_id, id);
    assert!(environment.fake.state().watched.is_empty());
}

#[test]
fn it_goes_on_when_nobody_hears_of_its_progress() {
    let environment = environment(&[]);
    let mut child = environment.start(LINE);
    drop((child.stderr.take(), child.stdout.take()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(std::fs::read(environment.path("out.ply")).unwrap(), [7; 300_000]);
}

#[test]
fn the_same_request_sent_again_is_the_same_job() {
    let environment = environment(&[]);
    let line = format!("{LINE} --request-id 5f0c54a6-6b0d-4d6f-9a80-6a7a0b1f4f11");
    assert_eq!(environment.run(&line).code, 0);
    let first = spec_of(&environment).scene;
    let marked = environment.fake.store("marked.ply", b"marked");
    environment
        .fake
        .plan([success(Outcome::EmbedResult(figures(&marked, "")))]);
    let ran = environment.run(&line);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(std::fs::read(environment.path("out.ply")).unwrap(), b"marked");
    // What was sent again is deleted, what the job has is not.
    let again = spec_of(&environment).scene;
    let state = environment.fake.state();
    assert_eq!((state.jobs.len(), state.created.len(), state.uploads), (1, 2, 2));
    assert_eq!(state.deleted, [again]);
    assert!(state.artifacts.contains_key(&first));
}

#[test]
fn a_scene_that_is_there_already_is_not_sent() {
    let environment = environment(&[]);
    let name = environment.fake.store("in.ply", b"ply");
    let ran = environment.run(&format!("embed {name} -o out.ply --key website --message c0ffee42"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(spec_of(&environment).scene, name);
    assert_eq!(environment.fake.state().uploads, 0);
    assert!(!ran.err.contains("note"), "{}", ran.err);
}

/// What is in an artifact is not known before; the worker names what it made of it.
#[test]
fn a_name_of_another_format_is_told_of() {
    let environment = environment(&[]);
    let name = environment.fake.store("in.ply", b"ply");
    let ran = environment.run(&format!("embed {name} -o out.spz --key website --message c0ffee42"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(
        ran.err.contains("note: out.spz would pass for SPZ") && ran.err.contains("name it *.ply"),
        "{}",
        ran.err
    );
    assert!(environment.path("out.spz").is_file());
}

#[test]
fn mistakes_are_found_before_anything_is_sent() {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    environment.file("photo.ply", PICTURE);
    environment.file("notes.ply", b"Dear diary");
    for (line, told) in [
        (
            "embed in.ply -o out.ply --key website --message c0ffee",
            "--message: must be 8 hexadecimal digits",
        ),
        (
            "embed in.ply -o missing/out.ply --key website --message c0ffee42",
            "missing/out.ply",
        ),
        ("embed in.ply -o . --key website --message c0ffee42", "a folder"),
        (
            "embed missing.ply -o out.ply --key website --message c0ffee42",
            "missing.ply",
        ),
        (
            "embed in.ply -o out.ply --key other --message c0ffee42",
            "there is no key `other`",
        ),
        (
            "embed in.ply -o out.splat --key website --message c0ffee42",
            "--output: out.splat would pass for .splat",
        ),
        (
            "embed photo.ply -o out.ply --key website --message c0ffee42",
            "photo.ply: a picture, and no scene",
        ),
        (
            "embed notes.ply -o out.ply --key website --message c0ffee42",
            "notes.ply: not a PNG, JPEG or WebP picture, and not a scene: neither a PLY",
        ),
    ] {
        let ran = environment.run(line);
        assert_eq!(ran.code, 1, "{line}");
        assert!(ran.err.contains(told), "{line}: {}", ran.err);
    }
    assert_eq!(environment.fake.state().uploads, 0);
    assert_eq!(environment.files(), ["in.ply", "notes.ply", "photo.ply"]);
}

#[test]
fn what_a_refused_job_would_have_used_is_deleted() {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply");
    let mut details = ErrorDetails::new();
    details
        .set_error_info("INVALID_FIELD", "guardsplat", [("limit".to_owned(), "4096".to_owned())])
        .add_bad_request_violation("job.embed.size", "must be 16 to 4096");
    let status = Status::with_error_details(Code::InvalidArgument, "the job is not valid", details);
    environment.fake.state().create_errors.push_back(status);
    let ran = environment.run(&format!("{LINE} --json"));
    assert_eq!(ran.code, 1);
    let error = &ran.json()["error"];
    assert_eq!(
        (&error["code"], &error["reason"]),
        (&"INVALID_ARGUMENT".into(), &"INVALID_FIELD".into())
    );
    assert_eq!(error["field_violations"][0]["field"], "job.embed.size");
    assert_eq!(error["metadata"], serde_json::json!({"limit": "4096"}));
    assert!(
        ran.err.contains("\n  job.embed.size: must be 16 to 4096"),
        "{}",
        ran.err
    );
    let state = environment.fake.state();
    assert_eq!(state.created.len(), 1);
    assert_eq!(state.deleted.len(), 1);
    assert!(state.artifacts.is_empty());
}
