//! A worker's turn at the jobs of projects.
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::*;

use super::super::calls::asking;
use super::super::harness::{Server, key_output, metadata};

impl Server {
    /// Has a worker take the next job, which must be there.
    pub async fn take_as(&self, worker: &str) -> (Job, String) {
        let request = LeaseJobRequest {
            worker: "w".into(),
            wait: None,
            ..LeaseJobRequest::default()
        };
        let lease = self
            .worker
            .clone()
            .lease_job(asking(worker, request))
            .await
            .unwrap()
            .into_inner();
        (lease.job.expect("a job waits"), lease.lease_token)
    }

    /// Has a worker make the key that a job is to make.
    pub async fn finish_key(&self, job: &str, bits: u32, worker: &str) -> String {
        // Jobs of other projects wait too; they go back when this is done.
        let mut others = Vec::new();
        let lease_token = loop {
            let (taken, token) = self.take_as(worker).await;
            if taken.name == job {
                break token;
            }
            others.push((taken.name, token));
        };
        let file = b"the key file";
        let first = OutputMetadata {
            job: job.into(),
            lease_token: lease_token.clone(),
            upload: Some(metadata("key", file)),
            secret: true,
        };
        let payloads = [
            upload_output_request::Payload::Metadata(first),
            upload_output_request::Payload::Chunk(file.to_vec()),
        ];
        let messages = payloads.map(|payload| UploadOutputRequest { payload: Some(payload) });
        let upload = asking(worker, tokio_stream::iter(messages));
        let output = self
            .worker
            .clone()
            .upload_output(upload)
            .await
            .unwrap()
            .into_inner()
            .name;
        let complete = CompleteJobRequest {
            name: job.into(),
            lease_token,
            result: Some(Output::KeyOutput(key_output(bits, &output))),
            ..CompleteJobRequest::default()
        };
        self.worker
            .clone()
            .complete_job(asking(worker, complete))
            .await
            .unwrap();
        for (name, lease_token) in others {
            let release = asking(worker, ReleaseJobRequest { name, lease_token });
            self.worker.clone().release_job(release).await.unwrap();
        }
        let id = crate::service::names::ResourceKind::Job.parse("name", job).unwrap();
        let row = crate::ledger::JobStore::get_job(&*self.ledger(), id)
            .await
            .unwrap()
            .unwrap();
        match row.result {
            Some(crate::ledger::JobResult::CreateKey(result)) => result.key,
            other => panic!("{other:?}"),
        }
    }
}
