//! Workers, as the projects see them that they work for.
use guardsplat_proto::v1::ListWorkersRequest;
use guardsplat_proto::v1::job_service_client::JobServiceClient;

use super::calls::asking;
use super::harness::Server;
use super::projects::Project;
use crate::access::Scope::{Admin, Worker};

/// Workers are everybody's, their jobs are not.
#[tokio::test]
async fn workers_are_seen_and_what_they_have_of_others_is_not() {
    let server = Server::with_tokens().await;
    let worker = server.token("operator", &[Worker]).await;
    let studio = Project::new(&server, "studio", &worker).await;
    let other = server.token("other", &[Admin]).await;
    let seen = async |token: &str| {
        let request = asking(token, ListWorkersRequest {});
        let answer = JobServiceClient::new(server.channel.clone())
            .list_workers(request)
            .await;
        answer.unwrap().into_inner().workers.remove(0)
    };
    let idle = seen(&other).await;
    assert_eq!((idle.name.as_str(), idle.busy, idle.start_time), ("w", false, None));
    server.take_as(&worker).await;
    let (own, theirs) = (seen(&studio.token).await, seen(&other).await);
    assert_eq!((own.busy, &own.job, own.attempt), (true, &studio.job, 1));
    assert_eq!((theirs.busy, theirs.job.as_str(), theirs.attempt), (true, "", 0));
    assert!(own.start_time.is_some() && own.seen_time.is_some());
}
