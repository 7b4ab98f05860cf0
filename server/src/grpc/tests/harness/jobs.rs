//! What a client and a worker do with a server.
use std::time::Duration;

use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{
    Artifact, CompleteJobRequest, CreateJobRequest, EmbedSpec, GetJobRequest, Job, KeySpec, LeaseJobRequest,
    LeaseJobResponse, OutputMetadata, upload_output_request,
};
use tonic::{Response, Status};

use super::*;

impl Server {
    pub async fn create(&self, spec: Spec) -> Job {
        let job = Job {
            spec: Some(spec),
            ..Default::default()
        };
        self.submit(job, "").await.unwrap().into_inner()
    }

    pub async fn submit(&self, job: Job, request_id: &str) -> Result<Response<Job>, Status> {
        let request = CreateJobRequest {
            job: Some(job),
            request_id: request_id.into(),
        };
        self.jobs.clone().create_job(request).await
    }

    pub async fn job(&self, name: &str) -> Job {
        let request = GetJobRequest { name: name.into() };
        self.jobs.clone().get_job(request).await.unwrap().into_inner()
    }

    pub async fn upload(&self, name: &str, bytes: &[u8]) -> Artifact {
        let messages = upload_messages(metadata(name, bytes), bytes);
        self.artifacts
            .clone()
            .upload_artifact(tokio_stream::iter(messages))
            .await
            .unwrap()
            .into_inner()
    }

    /// Leases the next job, or gets an empty answer.
    pub async fn lease(&self, wait: Duration) -> LeaseJobResponse {
        let wait = Some(prost_types::Duration::try_from(wait).unwrap());
        let request = LeaseJobRequest {
            worker: "test".into(),
            wait,
            ..LeaseJobRequest::default()
        };
        self.worker.clone().lease_job(request).await.unwrap().into_inner()
    }

    /// Leases the next job, which must be there.
    pub async fn take(&self) -> (Job, String) {
        let lease = self.lease(Duration::ZERO).await;
        (lease.job.expect("there is no job"), lease.lease_token)
    }

    pub async fn output(
        &self,
        job: &str,
        token: &str,
        bytes: &[u8],
        secret: bool,
    ) -> Result<Response<Artifact>, Status> {
        let upload = metadata("output.bin", bytes);
        let first = OutputMetadata {
            job: job.into(),
            lease_token: token.into(),
            upload: Some(upload),
            secret,
        };
        let mut messages = vec![output_message(upload_output_request::Payload::Metadata(first))];
        let chunks = bytes.chunks(1 << 20).map(<[u8]>::to_vec);
        messages.extend(chunks.map(|chunk| output_message(upload_output_request::Payload::Chunk(chunk))));
        self.worker.clone().upload_output(tokio_stream::iter(messages)).await
    }

    /// The name of an output that was stored.
    pub async fn stored(&self, job: &str, token: &str, bytes: &[u8], secret: bool) -> String {
        let answer = self.output(job, token, bytes, secret).await;
        answer.unwrap().into_inner().name
    }

    pub async fn complete(&self, job: &str, token: &str, result: Output) -> Result<(), Status> {
        let request = CompleteJobRequest {
            name: job.into(),
            lease_token: token.into(),
            result: Some(result),
            ..CompleteJobRequest::default()
        };
        self.worker.clone().complete_job(request).await.map(|_| ())
    }

    /// A key made by a job, with this key file. The queue must be empty.
    pub async fn key(&self, bits: u32, file: &[u8]) -> String {
        let job = self
            .create(Spec::CreateKey(KeySpec {
                bits,
                seed: None,
                ..KeySpec::default()
            }))
            .await;
        let (leased, token) = self.take().await;
        assert_eq!(leased.name, job.name);
        let output = self.stored(&job.name, &token, file, true).await;
        self.complete(&job.name, &token, Output::KeyOutput(key_output(bits, &output)))
            .await
            .unwrap();
        match self.job(&job.name).await.result.unwrap() {
            guardsplat_proto::v1::job::Result::KeyResult(result) => result.key,
            other => panic!("{other:?}"),
        }
    }

    /// A queued `embed` job with a scene and a key of its own. The queue must be empty.
    pub async fn embed_job(&self) -> Job {
        let key = self.key(16, b"the key file").await;
        let scene = self.upload("scene.ply", b"a scene").await.name;
        self.create(Spec::Embed(EmbedSpec {
            scene,
            key,
            message: "beef".into(),
            ..Default::default()
        }))
        .await
    }
}
