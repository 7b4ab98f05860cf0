//! What `CreateJob` takes and refuses.
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{
    CancelJobRequest, DeleteArtifactRequest, EmbedSpec, Failure, Job, KeySpec, Progress, VerifySpec, job,
};
use tonic::Code;
use uuid::Uuid;

use super::harness::{Server, invalid, key_spec, not_found, refused, verify_spec};
use crate::service::Limits;

fn of(spec: Spec) -> Job {
    Job {
        spec: Some(spec),
        ..Default::default()
    }
}

#[tokio::test]
async fn every_wrong_field_is_named() {
    let server = Server::start().await;
    let artifact = format!("artifacts/{}", Uuid::now_v7());
    let key = format!("keys/{}", Uuid::now_v7());
    let embed = |change: fn(&mut EmbedSpec)| {
        let mut spec = EmbedSpec {
            scene: artifact.clone(),
            key: key.clone(),
            message: "ff".into(),
            ..Default::default()
        };
        change(&mut spec);
        of(Spec::Embed(spec))
    };
    let verify = |change: fn(&mut VerifySpec)| {
        let mut spec = VerifySpec {
            suspects: vec![artifact.clone()],
            key: key.clone(),
            ..Default::default()
        };
        change(&mut spec);
        of(Spec::Verify(spec))
    };
    let job = |change: fn(&mut Job)| {
        let mut job = of(key_spec(32));
        change(&mut job);
        job
    };
    let cases = [
        (embed(|s| s.scene.clear()), "job.embed.scene"),
        (
            embed(|s| s.scene = "artifacts/../../etc/passwd".into()),
            "job.embed.scene",
        ),
        (embed(|s| s.scene = s.key.clone()), "job.embed.scene"),
        (embed(|s| s.key = "keys/mine".into()), "job.embed.key"),
        (embed(|s| s.message.clear()), "job.embed.message"),
        (embed(|s| s.preset = 17), "job.embed.preset"),
        (embed(|s| s.cameras = "cameras.json".into()), "job.embed.cameras"),
        (verify(|s| s.cameras = s.key.clone()), "job.verify.cameras"),
        (verify(|s| s.original = "scene.ply".into()), "job.verify.original"),
        (embed(|s| s.scene_kind = 9), "job.embed.scene_kind"),
        (verify(|s| s.scene_kind = -1), "job.verify.scene_kind"),
        (
            verify(|s| (s.scene_kind, s.cameras) = (2, s.suspects[0].clone())),
            "job.verify.scene_kind",
        ),
        (embed(|s| s.robust_to = vec![6, 0]), "job.embed.robust_to[1]"),
        (embed(|s| s.robust_to = vec![6, 13, 6]), "job.embed.robust_to[2]"),
        (embed(|s| s.size = 15), "job.embed.size"),
        (embed(|s| s.size = 4097), "job.embed.size"),
        (verify(|s| s.suspects.clear()), "job.verify.suspects"),
        (
            verify(|s| s.suspects = vec![s.suspects[0].clone(); 1001]),
            "job.verify.suspects",
        ),
        (
            verify(|s| s.suspects = vec![s.suspects[0].clone(); 2]),
            "job.verify.suspects[1]",
        ),
        (verify(|s| s.suspects.push("jobs/x".into())), "job.verify.suspects[1]"),
        (verify(|s| s.key.clear()), "job.verify.key"),
        (verify(|s| s.views = 10_001), "job.verify.views"),
        (verify(|s| s.size = 1), "job.verify.size"),
        (
            of(Spec::CreateKey(KeySpec {
                bits: 0,
                seed: None,
                ..KeySpec::default()
            })),
            "job.create_key.bits",
        ),
        (
            of(Spec::CreateKey(KeySpec {
                bits: 151,
                seed: None,
                ..KeySpec::default()
            })),
            "job.create_key.bits",
        ),
        (job(|j| j.spec = None), "job.spec"),
        (job(|j| j.display_name = "x".repeat(64)), "job.display_name"),
        (job(|j| j.display_name = "a\u{7}".into()), "job.display_name"),
        (job(|j| j.name = format!("jobs/{}", Uuid::now_v7())), "job.name"),
        (job(|j| j.state = 1), "job.state"),
        (job(|j| j.cancel_requested = true), "job.cancel_requested"),
        (job(|j| j.attempt = 1), "job.attempt"),
        (job(|j| j.max_attempts = 9), "job.max_attempts"),
        (job(|j| j.queue_position = Some(0)), "job.queue_position"),
        (job(|j| j.progress = Some(Progress::default())), "job.progress"),
        (
            job(|j| j.result = Some(job::Result::KeyResult(Default::default()))),
            "job.result",
        ),
        (job(|j| j.failure = Some(Failure::default())), "job.failure"),
        (job(|j| j.create_time = Some(Default::default())), "job.create_time"),
        (job(|j| j.update_time = Some(Default::default())), "job.update_time"),
        (job(|j| j.start_time = Some(Default::default())), "job.start_time"),
        (job(|j| j.end_time = Some(Default::default())), "job.end_time"),
        (job(|j| j.retry_time = Some(Default::default())), "job.retry_time"),
    ];
    for (job, field) in cases {
        assert_eq!(invalid(server.submit(job, "").await), [field]);
    }
    let request_ids = ["7", &Uuid::nil().to_string(), "not-a-uuid", "../x"];
    for request_id in request_ids {
        assert_eq!(
            invalid(server.submit(of(key_spec(8)), request_id).await),
            ["request_id"],
            "{request_id}"
        );
    }
    let request = guardsplat_proto::v1::CreateJobRequest::default();
    assert_eq!(invalid(server.jobs.clone().create_job(request).await), ["job"]);
    // None of them left anything.
    assert_eq!(server.lease(std::time::Duration::ZERO).await.job, None);
}

#[tokio::test]
async fn all_that_is_wrong_is_told_at_once() {
    let server = Server::start().await;
    let spec = EmbedSpec {
        size: 3,
        preset: 9,
        ..Default::default()
    };
    let job = Job {
        display_name: "\n".into(),
        attempt: 2,
        ..of(Spec::Embed(spec))
    };
    let fields = invalid(server.submit(job, "x").await);
    let embed = ["scene", "key", "message", "preset", "size"].map(|field| format!("job.embed.{field}"));
    let wanted = ["request_id", "job.display_name", "job.attempt"]
        .map(str::to_owned)
        .into_iter()
        .chain(embed);
    assert_eq!(fields, wanted.collect::<Vec<_>>());
}

#[tokio::test]
async fn what_a_job_needs_must_be_there() {
    let server = Server::start().await;
    let key = server.key(10, b"key file").await;
    let scene = server.upload("scene.ply", b"scene").await.name;
    let (no_key, no_scene) = (
        format!("keys/{}", Uuid::now_v7()),
        format!("artifacts/{}", Uuid::now_v7()),
    );
    assert_eq!(
        not_found(server.submit(of(verify_spec(&scene, &no_key)), "").await),
        no_key
    );
    assert_eq!(
        not_found(server.submit(of(verify_spec(&no_scene, &key)), "").await),
        no_scene
    );
    server.submit(of(verify_spec(&scene, &key)), "").await.unwrap();
}

#[tokio::test]
async fn a_message_fits_its_key() {
    let server = Server::start().await;
    let key = server.key(10, b"key file").await;
    let scene = server.upload("scene.ply", b"scene").await.name;
    let with = |message: &str| {
        let (scene, key) = (scene.clone(), key.clone());
        of(Spec::Embed(EmbedSpec {
            scene,
            key,
            message: message.into(),
            ..Default::default()
        }))
    };
    for message in ["400", "3fff", "3f", "3fg", "0x", "fff"] {
        assert_eq!(
            invalid(server.submit(with(message), "").await),
            ["job.embed.message"],
            "{message}"
        );
    }
    for message in ["3ff", "000", "0x2aB"] {
        server.submit(with(message), "").await.unwrap();
    }
    let (suspects, key) = (vec![scene.clone()], key.clone());
    let wrong = Spec::Verify(VerifySpec {
        suspects,
        key,
        message: "fff".into(),
        ..Default::default()
    });
    assert_eq!(invalid(server.submit(of(wrong), "").await), ["job.verify.message"]);
}

#[tokio::test]
async fn a_request_sent_again_is_the_same_job() {
    let server = Server::start().await;
    let id = Uuid::new_v4().to_string();
    let first = server.submit(of(key_spec(8)), &id).await.unwrap().into_inner();
    let again = server.submit(of(key_spec(8)), &id).await.unwrap().into_inner();
    assert_eq!(again.name, first.name);
    let other = Job {
        display_name: "other".into(),
        ..of(key_spec(8))
    };
    let details = refused(
        server.submit(other, &id).await,
        Code::AlreadyExists,
        "REQUEST_ID_REUSED",
    );
    assert_eq!(details.error_info().unwrap().metadata["request_id"], id);
    let fresh = server
        .submit(of(key_spec(8)), &Uuid::new_v4().to_string())
        .await
        .unwrap()
        .into_inner();
    assert_ne!(fresh.name, first.name);

    let server = server.restart(Limits::default()).await;
    assert_eq!(
        server.submit(of(key_spec(8)), &id).await.unwrap().into_inner().name,
        first.name
    );
}

#[tokio::test]
async fn a_request_with_the_same_bytes_is_the_same_request() {
    let server = Server::start().await;
    let key = server.key(10, b"key file").await;
    let (id, pictures) = (Uuid::new_v4().to_string(), Uuid::new_v4().to_string());
    let embed = |scene: &str| {
        of(Spec::Embed(EmbedSpec {
            scene: scene.into(),
            key: key.clone(),
            message: "2aa".into(),
            ..Default::default()
        }))
    };
    let verify = |suspects: [&str; 2]| {
        of(Spec::Verify(VerifySpec {
            suspects: suspects.map(str::to_owned).to_vec(),
            key: key.clone(),
            ..Default::default()
        }))
    };
    let submit = async |job: Job, id: &str| server.submit(job, id).await.map(|answer| answer.into_inner().name);
    let [first, copy] = ["scene.ply", "copy.ply"].map(|name| server.upload(name, b"scene"));
    let (first, copy) = (first.await.name, copy.await.name);
    let other = server.upload("scene.ply", b"SCENE").await.name;
    let job = submit(embed(&first), &id).await.unwrap();
    assert_eq!(submit(embed(&copy), &id).await.unwrap(), job);
    refused(
        submit(embed(&other), &id).await,
        Code::AlreadyExists,
        "REQUEST_ID_REUSED",
    );
    // The job reads what it was made with, whoever sent that again.
    let Some(Spec::Embed(spec)) = server.job(&job).await.spec else {
        panic!("{job}")
    };
    assert_eq!(spec.scene, first);

    // Of several each counts, and their order.
    let job = submit(verify([&first, &other]), &pictures).await.unwrap();
    assert_eq!(submit(verify([&copy, &other]), &pictures).await.unwrap(), job);
    for wrong in [[&other, &first], [&first, &copy]] {
        let again = submit(verify(wrong.map(String::as_str)), &pictures).await;
        refused(again, Code::AlreadyExists, "REQUEST_ID_REUSED");
    }
    // Cameras are no suspect, and neither is the original.
    let alone = VerifySpec {
        suspects: vec![first.clone()],
        key: key.clone(),
        ..Default::default()
    };
    let seen = VerifySpec {
        cameras: other.clone(),
        ..alone.clone()
    };
    let compared = VerifySpec {
        original: other.clone(),
        ..alone
    };
    for spec in [seen, compared] {
        refused(
            submit(of(Spec::Verify(spec)), &pictures).await,
            Code::AlreadyExists,
            "REQUEST_ID_REUSED",
        );
    }
    // What is gone is known by its name, and nothing else is taken for it.
    server
        .jobs
        .clone()
        .cancel_job(CancelJobRequest { name: job.clone() })
        .await
        .unwrap();
    let delete = DeleteArtifactRequest { name: other.clone() };
    server.artifacts.clone().delete_artifact(delete).await.unwrap();
    assert_eq!(submit(verify([&first, &other]), &pictures).await.unwrap(), job);
    let again = submit(verify([&copy, &other]), &pictures).await;
    refused(again, Code::AlreadyExists, "REQUEST_ID_REUSED");
}

#[tokio::test]
async fn a_full_queue_says_when_to_come_back() {
    let server = Server::with(Limits {
        max_queued: 2,
        ..Limits::default()
    })
    .await;
    let id = Uuid::new_v4().to_string();
    let first = server.submit(of(key_spec(8)), &id).await.unwrap().into_inner();
    server.create(key_spec(8)).await;
    // A request that is sent again asks for no more room.
    let again = server.submit(of(key_spec(8)), &id).await.unwrap().into_inner();
    assert_eq!(again.name, first.name);
    let details = refused(
        server.submit(of(key_spec(8)), "").await,
        Code::ResourceExhausted,
        "QUEUE_FULL",
    );
    assert!(details.retry_info().unwrap().retry_delay.unwrap() > std::time::Duration::ZERO);
    // A worker takes one, and there is room again.
    server.take().await;
    server.create(key_spec(8)).await;
}
