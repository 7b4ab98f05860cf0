//! Marking assets and claims about them, from submission to evidence; workers are played by the tests.
mod decisions;

use guardsplat_codeword::Message;
use guardsplat_evidence::{Checked, Picture, VerifyingKey, check};
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Result as JobResult, Spec};
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{
    CompleteJobRequest, DownloadArtifactRequest, EmbedResult, EmbedSpec, FramedReading, Job, SeenView, VerifyResult,
    VerifySpec, download_artifact_response,
};
use tonic::{Code, Status};

use super::harness::{Server, refused};
use super::registry::{asset, create_asset, create_owner, public_key};
use crate::service::Limits;

/// A server with a key of 64 bits and two owners, of whom the first has two assets and the second one.
pub(super) struct Bench {
    pub(super) server: Server,
    pub(super) key: String,
    pub(super) owners: [String; 2],
    /// With their original.
    pub(super) assets: Vec<(String, String)>,
}

/// A view that a worker saw, three levels off the original.
fn seen(value: u8) -> SeenView {
    let png = |value| Picture::from_rgb(2, 1, &[value; 6]).unwrap().png().unwrap().to_vec();
    SeenView {
        name: "view 1".into(),
        read: png(value),
        original: png(value - 3),
    }
}

pub(super) async fn bench_with(limits: Limits) -> Bench {
    let server = Server::with(limits).await;
    let key = server.key(64, b"key file").await;
    let mut owners = Vec::new();
    for name in ["Studio Nord", "Studio Süd"] {
        owners.push(create_owner(&server, name, "").await.unwrap().name);
    }
    let mut assets = Vec::new();
    for (owner, bytes) in [(0, b"first"), (0, b"other"), (1, b"third")] {
        let scene = server.upload("scene.ply", bytes).await.name;
        let new = asset(&owners[owner], &key, Original::Artifact(scene.clone()));
        assets.push((create_asset(&server, new, "").await.unwrap().name, scene));
    }
    let [one, two] = <[String; 2]>::try_from(owners).unwrap();
    Bench {
        server,
        key,
        owners: [one, two],
        assets,
    }
}

pub(super) async fn bench() -> Bench {
    bench_with(Limits::default()).await
}

fn embed(key: &str, scene: &str, asset: &str) -> EmbedSpec {
    EmbedSpec {
        scene: scene.into(),
        key: key.into(),
        asset: asset.into(),
        ..EmbedSpec::default()
    }
}

pub(super) fn logits(word: &str, wrong: usize) -> Vec<f32> {
    let word = Message::from_u64(u64::from_str_radix(word, 16).unwrap());
    let sign = |(i, bit): (usize, bool)| {
        if bit != (i % 10 == 3 && i / 10 < wrong) {
            4.0
        } else {
            -4.0
        }
    };
    word.bits().enumerate().map(sign).collect()
}

pub(super) fn framed(quarter_turns: u32, logits: Vec<f32>) -> FramedReading {
    FramedReading {
        quarter_turns,
        views: 20,
        logits,
        ..FramedReading::default()
    }
}

impl Bench {
    pub(super) async fn submit(&self, spec: Spec) -> Result<Job, Status> {
        let job = Job {
            spec: Some(spec),
            ..Job::default()
        };
        self.server.submit(job, "").await.map(|answer| answer.into_inner())
    }

    pub(super) async fn embed(&self, scene: &str, asset: &str) -> Result<Job, Status> {
        self.submit(Spec::Embed(embed(&self.key, scene, asset))).await
    }

    pub(super) async fn verify(&self, claim: VerifySpec) -> Result<Job, Status> {
        let mut suspects = claim.suspects.clone();
        if suspects.is_empty() {
            suspects.push(self.server.upload("suspect.ply", b"suspect").await.name);
        }
        let spec = VerifySpec {
            suspects,
            key: self.key.clone(),
            ..claim
        };
        self.submit(Spec::Verify(spec)).await
    }

    /// The word that a worker is told to embed.
    pub(super) async fn word(&self, which: usize) -> String {
        let (asset, scene) = &self.assets[which];
        let job = self.embed(scene, asset).await.unwrap();
        let (leased, token) = self.server.take().await;
        assert_eq!(leased.name, job.name);
        let Some(Spec::Embed(spec)) = leased.spec else { panic!() };
        assert_eq!((spec.message.len(), &spec.asset), (16, asset));
        let result = EmbedResult {
            scene: self.server.stored(&job.name, &token, b"marked", false).await,
            comparison: self.server.stored(&job.name, &token, b"picture", false).await,
            message: spec.message.clone(),
            bit_accuracy: 1.0,
            ..EmbedResult::default()
        };
        let readings = vec![framed(0, logits(&spec.message, 0))];
        self.complete(&job.name, &token, Output::EmbedResult(result), readings)
            .await
            .unwrap();
        spec.message
    }

    pub(super) async fn complete(
        &self,
        job: &str,
        token: &str,
        result: Output,
        readings: Vec<FramedReading>,
    ) -> Result<(), Status> {
        let request = CompleteJobRequest {
            name: job.into(),
            lease_token: token.into(),
            result: Some(result),
            readings,
            engine: "a test".into(),
            views: vec![seen(103)],
            ..CompleteJobRequest::default()
        };
        self.server.worker.clone().complete_job(request).await.map(|_| ())
    }

    /// What comes of a claim on these readings.
    pub(super) async fn claimed(&self, claim: VerifySpec, readings: Vec<FramedReading>) -> (VerifyResult, Checked) {
        let job = self.verify(claim).await.unwrap().name;
        let (_, token) = self.server.take().await;
        let read = VerifyResult {
            verdict: Verdict::Inconclusive.into(),
            message: "what was read".into(),
            views: 20,
            ..VerifyResult::default()
        };
        self.complete(&job, &token, Output::VerifyResult(read.clone()), readings.clone())
            .await
            .unwrap();
        let Some(JobResult::VerifyResult(result)) = self.server.job(&job).await.result else {
            panic!()
        };
        // Said again because the answer was lost, it is answered in the same way, and leaves no second report.
        self.complete(&job, &token, Output::VerifyResult(read.clone()), readings)
            .await
            .unwrap();
        let other = self
            .complete(&job, &token, Output::VerifyResult(read), Vec::new())
            .await;
        refused(other, Code::Aborted, "LEASE_LOST");
        assert_eq!(
            self.server.job(&job).await.result,
            Some(JobResult::VerifyResult(result.clone()))
        );
        assert_eq!(result.message, "");
        let checked = self.report(&result.evidence_html).await;
        assert!(checked.holds(), "{checked:?}");
        let views = &checked.evidence.as_ref().unwrap().views;
        let difference = Picture::from_rgb(2, 1, &[30; 6]).unwrap();
        assert_eq!(
            views.iter().map(|v| v.difference.clone()).collect::<Vec<_>>(),
            [Some(difference)]
        );
        assert!(self.report(&result.evidence_json).await.holds());
        (result, checked)
    }

    /// The job that left this result.
    pub(super) async fn job_of(&self, result: &VerifyResult) -> String {
        let request = guardsplat_proto::v1::ListJobsRequest::default();
        let jobs = self
            .server
            .jobs
            .clone()
            .list_jobs(request)
            .await
            .unwrap()
            .into_inner()
            .jobs;
        let wanted = Some(JobResult::VerifyResult(result.clone()));
        jobs.into_iter().find(|job| job.result == wanted).unwrap().name
    }

    pub(super) async fn report(&self, artifact: &str) -> Checked {
        let request = DownloadArtifactRequest {
            name: artifact.into(),
            offset: 0,
        };
        let answer = self.server.artifacts.clone().download_artifact(request).await;
        let (mut stream, mut bytes) = (answer.unwrap().into_inner(), Vec::new());
        while let Some(message) = stream.message().await.unwrap() {
            if let Some(download_artifact_response::Payload::Chunk(chunk)) = message.payload {
                bytes.extend(chunk);
            }
        }
        let key = public_key(&self.server).await.to_bytes();
        check(&bytes, &VerifyingKey::from_bytes(&key).unwrap())
    }
}

pub(super) fn of_asset(asset: &str) -> VerifySpec {
    VerifySpec {
        asset: asset.into(),
        ..VerifySpec::default()
    }
}

pub(super) fn of_owner(owner: &str) -> VerifySpec {
    VerifySpec {
        owner: owner.into(),
        ..VerifySpec::default()
    }
}

pub(super) fn search() -> VerifySpec {
    VerifySpec {
        search: true,
        ..VerifySpec::default()
    }
}
