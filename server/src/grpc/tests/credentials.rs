//! Content credentials of marked scenes: made by jobs that ask for them, found by the mark, gone when they are deleted.
//! Workers are played by the tests.
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Result as JobResult, Spec};
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{
    CompleteJobRequest, Credentials, DeleteArtifactRequest, EmbedResult, EmbedSpec, VerifyResult, VerifySpec,
};
use tonic::Status;

use super::claims::{Bench, bench, framed, logits, of_asset};
use super::harness::{Server, invalid};

/// Values of soft bindings, as keys make them.
pub(crate) const VALUES: [&str; 2] = [
    "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2",
    "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul3",
];
/// What sidecars hold here.
pub(crate) const SIDECAR: &[u8] = b"a manifest store";

/// What a worker tells of credentials, with its other outputs.
async fn result(server: &Server, job: &str, token: &str, manifest: &str) -> EmbedResult {
    EmbedResult {
        scene: server.stored(job, token, b"marked", false).await,
        comparison: server.stored(job, token, b"picture", false).await,
        credentials: Some(Credentials {
            artifact: server.stored(job, token, SIDECAR, false).await,
            manifest: manifest.into(),
            soft_binding: VALUES[0].into(),
            test_certificate: true,
            job: String::new(),
        }),
        ..EmbedResult::default()
    }
}

async fn submit(server: &Server, spec: EmbedSpec) -> (String, String) {
    let spec = EmbedSpec {
        credentials: true,
        ..spec
    };
    let job = server.create(Spec::Embed(spec)).await.name;
    let (leased, token) = server.take().await;
    assert_eq!(leased.name, job);
    assert!(matches!(leased.spec, Some(Spec::Embed(spec)) if spec.credentials));
    (job, token)
}

/// Makes specs of a scene and a key of 32 bits that are on the server, with any message.
pub(crate) async fn raw_spec(server: &Server) -> impl Fn(&str) -> EmbedSpec {
    let key = server.key(32, b"the key file").await;
    let scene = server.upload("scene.ply", b"a scene").await.name;
    move |message| EmbedSpec {
        scene: scene.clone(),
        key: key.clone(),
        message: message.into(),
        ..EmbedSpec::default()
    }
}

/// Has a scene marked with credentials.
pub(crate) async fn marked(server: &Server, spec: EmbedSpec, manifest: &str) -> Credentials {
    let asset = !spec.asset.is_empty();
    let (job, token) = submit(server, spec).await;
    let result = result(server, &job, &token, manifest).await;
    let request = CompleteJobRequest {
        name: job.clone(),
        lease_token: token,
        result: Some(Output::EmbedResult(result)),
        readings: asset.then(|| framed(0, vec![4.0; 64])).into_iter().collect(),
        ..CompleteJobRequest::default()
    };
    for _ in 0..2 {
        // Said again because the answer was lost, there is one all the same.
        server.worker.clone().complete_job(request.clone()).await.unwrap();
    }
    match server.job(&job).await.result {
        Some(JobResult::EmbedResult(result)) => {
            let made = result.credentials.unwrap();
            assert_eq!((&made.job, made.manifest.as_str()), (&job, manifest));
            made
        }
        other => panic!("{other:?}"),
    }
}

pub(crate) async fn delete(server: &Server, artifact: &str) {
    let request = DeleteArtifactRequest { name: artifact.into() };
    server.artifacts.clone().delete_artifact(request).await.unwrap();
}

fn of(bench: &Bench, which: usize) -> EmbedSpec {
    let (asset, scene) = &bench.assets[which];
    EmbedSpec {
        scene: scene.clone(),
        key: bench.key.clone(),
        asset: asset.clone(),
        ..EmbedSpec::default()
    }
}

#[tokio::test]
async fn a_claim_that_matches_names_the_credentials_of_its_mark() {
    let bench = bench().await;
    let server = &bench.server;
    let older = marked(server, of(&bench, 0), "urn:c2pa:1").await;
    let newer = marked(server, of(&bench, 0), "urn:c2pa:2").await;
    marked(server, of(&bench, 1), "urn:c2pa:3").await;
    let words = [bench.word(0).await, bench.word(2).await];
    let read = |word: &str| vec![framed(0, logits(word, 3))];
    let (asset, third) = (&bench.assets[0].0, &bench.assets[2].0);
    let search = || VerifySpec {
        search: true,
        ..VerifySpec::default()
    };
    for claim in [of_asset(asset), search()] {
        let (found, _) = bench.claimed(claim, read(&words[0])).await;
        assert_eq!(found.verdict(), Verdict::Match);
        assert_eq!(found.credentials, [newer.clone(), older.clone()]);
    }
    // Marked without, and not there.
    let (found, _) = bench.claimed(search(), read(&words[1])).await;
    assert_eq!((found.verdict(), &found.asset), (Verdict::Match, third));
    assert_eq!(found.credentials, []);
    let (missed, _) = bench.claimed(of_asset(asset), read(&words[1])).await;
    assert_eq!((missed.verdict(), missed.credentials), (Verdict::NoMatch, vec![]));
    // What is deleted is not named any more.
    delete(server, &newer.artifact).await;
    let (found, _) = bench.claimed(search(), read(&words[0])).await;
    assert_eq!(found.credentials, [older]);
}

#[tokio::test]
async fn a_raw_message_that_matches_names_them_too() {
    let server = Server::start().await;
    let spec = raw_spec(&server).await;
    let EmbedSpec { scene, key, .. } = spec("");
    let made = marked(&server, spec("0xC0FFEE42"), "urn:c2pa:1").await;
    for (message, verdict, credentials) in [
        ("c0ffee42", Verdict::Match, vec![made.clone()]),
        ("c0ffee42", Verdict::NoMatch, vec![]),
        ("c0ffee43", Verdict::Match, vec![]),
        ("", Verdict::Inconclusive, vec![]),
    ] {
        let suspect = VerifySpec {
            suspects: vec![scene.clone()],
            key: key.clone(),
            message: message.into(),
            ..VerifySpec::default()
        };
        let job = server.create(Spec::Verify(suspect)).await.name;
        let (_, token) = server.take().await;
        let read = VerifyResult {
            verdict: verdict.into(),
            // What a worker says of any is of no interest.
            credentials: vec![Credentials::default()],
            ..VerifyResult::default()
        };
        server.complete(&job, &token, Output::VerifyResult(read)).await.unwrap();
        match server.job(&job).await.result {
            Some(JobResult::VerifyResult(told)) => assert_eq!(told.credentials, credentials, "{message} {verdict:?}"),
            other => panic!("{other:?}"),
        }
    }
}

#[tokio::test]
async fn what_was_asked_for_must_come() {
    let server = Server::start().await;
    let key = server.key(32, b"the key file").await;
    let scene = server.upload("scene.ply", b"a scene").await.name;
    let spec = || EmbedSpec {
        scene: scene.clone(),
        key: key.clone(),
        message: "c0ffee42".into(),
        ..EmbedSpec::default()
    };
    let (job, token) = submit(&server, spec()).await;
    let good = result(&server, &job, &token, "urn:c2pa:1").await;
    let told = good.credentials.clone().unwrap();
    let said = async |credentials: Option<Credentials>| -> Result<(), Status> {
        let result = EmbedResult {
            credentials,
            ..good.clone()
        };
        server.complete(&job, &token, Output::EmbedResult(result)).await
    };
    assert_eq!(invalid(said(None).await), ["embed_result.credentials"]);
    let as_scene = Credentials {
        artifact: good.scene.clone(),
        ..told.clone()
    };
    assert_eq!(
        invalid(said(Some(as_scene)).await),
        ["embed_result.credentials.artifact"]
    );
    let no_value = Credentials {
        soft_binding: "c0ffee42".into(),
        ..told.clone()
    };
    assert_eq!(
        invalid(said(Some(no_value)).await),
        ["embed_result.credentials.soft_binding"]
    );
    said(Some(told)).await.unwrap();

    // And what was not asked for must not.
    let plain = server.create(Spec::Embed(spec())).await.name;
    let (_, token) = server.take().await;
    let result = result(&server, &plain, &token, "urn:c2pa:2").await;
    let answer = server.complete(&plain, &token, Output::EmbedResult(result)).await;
    assert_eq!(invalid(answer), ["embed_result.credentials"]);
}
