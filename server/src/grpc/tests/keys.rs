//! Keys: made by a job, known to all, secret to all but workers.
use std::time::Duration;

use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Result as JobResult, Spec, State};
use guardsplat_proto::v1::key::State as KeyState;
use guardsplat_proto::v1::{
    DownloadArtifactRequest, DownloadKeyRequest, GetArtifactRequest, GetDownloadUrlRequest, GetKeyRequest, Job, Key,
    KeySpec, ListKeysRequest,
};
use tonic::{Code, Status};
use uuid::Uuid;

use super::harness::{Server, invalid, key_output, key_spec, not_found, refused, sha256, verify_spec};
use crate::service::Limits;

/// Longer than a chunk, and easily found on a disk.
fn key_file() -> Vec<u8> {
    b"the secret of this key ".repeat(100_000)
}

async fn download(server: &Server, job: &str, token: &str) -> Result<Vec<u8>, Status> {
    let request = DownloadKeyRequest {
        job: job.into(),
        lease_token: token.into(),
    };
    let mut stream = server.worker.clone().download_key(request).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(message) = stream.message().await? {
        assert!((1..=1 << 20).contains(&message.chunk.len()));
        bytes.extend(message.chunk);
    }
    Ok(bytes)
}

#[tokio::test]
async fn a_job_makes_a_key_that_later_jobs_read() {
    let server = Server::start().await;
    let job = Job {
        display_name: "ours".into(),
        spec: Some(key_spec(32)),
        ..Default::default()
    };
    let job = server.submit(job, "").await.unwrap().into_inner().name;
    let (_, token) = server.take().await;
    let output = server
        .output(&job, &token, &key_file(), true)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(
        (output.size_bytes, output.sha256),
        (key_file().len() as i64, sha256(&key_file()))
    );
    server
        .complete(&job, &token, Output::KeyOutput(key_output(32, &output.name)))
        .await
        .unwrap();
    // Said again, because the answer was lost, it makes no second key.
    server
        .complete(&job, &token, Output::KeyOutput(key_output(32, &output.name)))
        .await
        .unwrap();
    let all = server.keys.clone().list_keys(ListKeysRequest::default()).await.unwrap();
    assert_eq!(all.into_inner().keys.len(), 1);

    let done = server.job(&job).await;
    assert_eq!(done.state(), State::Succeeded);
    let Some(JobResult::KeyResult(result)) = done.result else {
        panic!("no key")
    };
    let key = server
        .keys
        .clone()
        .get_key(GetKeyRequest {
            name: result.key.clone(),
        })
        .await
        .unwrap()
        .into_inner();
    let wanted = Key {
        name: result.key.clone(),
        display_name: "ours".into(),
        bits: 32,
        clip: "a clip".into(),
        clip_sha256: sha256(b"weights"),
        seeded: false,
        create_time: key.create_time,
        job,
        state: KeyState::Active.into(),
        state_reason: String::new(),
        state_time: None,
    };
    assert_eq!(key, wanted);

    // Nobody gets at the secret as an artifact, and it is on the disk under no name.
    let mut artifacts = server.artifacts.clone();
    let name = output.name;
    assert_eq!(
        not_found(artifacts.get_artifact(GetArtifactRequest { name: name.clone() }).await),
        name
    );
    let request = DownloadArtifactRequest {
        name: name.clone(),
        offset: 0,
    };
    assert_eq!(not_found(artifacts.download_artifact(request).await), name);
    let request = GetDownloadUrlRequest { name: name.clone() };
    assert_eq!(not_found(artifacts.get_download_url(request).await), name);
    let files = server.files();
    assert_eq!(files.len(), 1);
    for file in files {
        let bytes = std::fs::read(file).unwrap();
        assert!(!bytes.windows(10).any(|part| part == b"the secret"));
    }

    // Whoever has a job that needs it does, also after a restart.
    let server = server.restart(Limits::default()).await;
    let scene = server.upload("scene.ply", b"scene").await.name;
    server.create(verify_spec(&scene, &result.key)).await;
    let (leased, token) = server.take().await;
    assert!(download(&server, &leased.name, &token).await.unwrap() == key_file());
    refused(
        download(&server, &leased.name, "another").await,
        Code::Aborted,
        "LEASE_LOST",
    );
}

#[tokio::test]
async fn keys_are_listed_newest_first() {
    let server = Server::start().await;
    let (first, second) = (server.key(8, b"a").await, server.key(16, b"b").await);
    let list = async |page_size, page_token: &str| {
        let request = ListKeysRequest {
            page_size,
            page_token: page_token.into(),
        };
        server
            .keys
            .clone()
            .list_keys(request)
            .await
            .map(|answer| answer.into_inner())
    };
    let names = |keys: &[Key]| keys.iter().map(|key| key.name.clone()).collect::<Vec<_>>();
    let all = list(0, "").await.unwrap();
    assert_eq!(
        (names(&all.keys), all.next_page_token.as_str()),
        (vec![second.clone(), first.clone()], "")
    );
    let page = list(1, "").await.unwrap();
    assert_eq!(names(&page.keys), [second]);
    let page = list(1, &page.next_page_token).await.unwrap();
    assert_eq!((names(&page.keys), page.next_page_token.as_str()), (vec![first], ""));
    assert_eq!(invalid(list(-1, "").await), ["page_size"]);
    assert_eq!(invalid(list(1, "x").await), ["page_token"]);
}

#[tokio::test]
async fn names_are_checked() {
    let server = Server::start().await;
    let mut keys = server.keys.clone();
    let nobody = format!("keys/{}", Uuid::now_v7());
    assert_eq!(
        not_found(keys.get_key(GetKeyRequest { name: nobody.clone() }).await),
        nobody
    );
    assert_eq!(
        invalid(
            keys.get_key(GetKeyRequest {
                name: "keys/../master.key".into()
            })
            .await
        ),
        ["name"]
    );
}

#[tokio::test]
async fn what_a_worker_says_of_a_key_is_checked() {
    let server = Server::start().await;
    let job = server
        .create(Spec::CreateKey(KeySpec {
            bits: 32,
            seed: Some(1),
            ..KeySpec::default()
        }))
        .await
        .name;
    let (_, token) = server.take().await;
    let file = server.stored(&job, &token, b"key", true).await;
    let open = server.stored(&job, &token, b"no key", false).await;
    let with = |change: fn(&mut Key)| {
        let mut output = key_output(32, &file);
        let key = output.key.as_mut().unwrap();
        key.seeded = true;
        change(key);
        output
    };
    let complete = async |output| server.complete(&job, &token, Output::KeyOutput(output)).await;
    assert_eq!(
        invalid(complete(with(|key| key.bits = 31)).await),
        ["key_output.key.bits"]
    );
    assert_eq!(
        invalid(complete(with(|key| key.seeded = false)).await),
        ["key_output.key.seeded"]
    );
    assert_eq!(
        invalid(complete(with(|key| key.clip.clear())).await),
        ["key_output.key.clip"]
    );
    assert_eq!(
        invalid(complete(with(|key| key.clip_sha256 = "0".into())).await),
        ["key_output.key.clip_sha256"]
    );
    let mut output = with(|_| {});
    output.result = None;
    assert_eq!(invalid(complete(output).await), ["key_output.result"]);
    let mut output = with(|_| {});
    output.key_file = open;
    assert_eq!(invalid(complete(output).await), ["result"]);
    assert_eq!(server.job(&job).await.state(), State::Running);
    complete(with(|_| {})).await.unwrap();
    assert_eq!(server.lease(Duration::ZERO).await.job, None);
}

#[tokio::test]
async fn key_files_are_short() {
    let server = Server::start().await;
    let job = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let answer = server.output(&job, &token, &vec![1; (4 << 20) + 1], true).await;
    assert_eq!(invalid(answer), ["metadata.upload.size_bytes"]);
    assert_eq!(invalid(download(&server, &job, &token).await), ["job"]);
}
