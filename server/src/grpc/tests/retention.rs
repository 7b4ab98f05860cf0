//! What goes by age, with its bytes; and that it does so while the server runs.
use std::time::Duration;

use guardsplat_proto::v1::{GetArtifactRequest, GetJobRequest};

use super::harness::{Server, not_found, soon};
use crate::service::Limits;
use crate::service::retention::RetentionPolicy;

#[tokio::test]
async fn what_is_old_goes_with_its_bytes() {
    let short = Some(Duration::from_millis(300));
    let limits = Limits {
        // How often is looked follows from it.
        abandoned_after: Duration::from_secs(1),
        retention: RetentionPolicy {
            uploads: short,
            outputs: None,
            jobs: short,
        },
        ..Limits::default()
    };
    let server = Server::with(limits).await;
    let waiting = server.embed_job().await;
    let unused = server.upload("unused.ply", b"unused").await.name;
    let cancelled = {
        let job = server.create(waiting.spec.clone().unwrap()).await.name;
        let request = guardsplat_proto::v1::CancelJobRequest { name: job.clone() };
        server.jobs.clone().cancel_job(request).await.unwrap();
        job
    };
    soon("the end of what is old", async || server.files().len() == 2).await;
    let request = GetArtifactRequest { name: unused };
    not_found(server.artifacts.clone().get_artifact(request).await);
    soon("the end of the job", async || {
        let request = GetJobRequest {
            name: cancelled.clone(),
        };
        server.jobs.clone().get_job(request).await.is_err()
    })
    .await;
    // The key, its job, and what the other job waits for are there.
    assert_eq!(server.job(&waiting.name).await.name, waiting.name);
    let (job, token) = server.take().await;
    assert_eq!(job.name, waiting.name);
    let request = guardsplat_proto::v1::DownloadKeyRequest {
        job: job.name,
        lease_token: token,
    };
    server.worker.clone().download_key(request).await.unwrap();
}
