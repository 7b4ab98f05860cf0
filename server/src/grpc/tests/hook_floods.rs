//! Hooks of projects that mean no good: slow ones, and what is told of jobs that changed since.
use std::time::Duration;

use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::delivery::State;
use guardsplat_proto::v1::hook_service_client::HookServiceClient;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{
    CancelJobRequest, CreateHookRequest, CreateJobRequest, DeleteArtifactRequest, EmbedResult, EmbedSpec, Hook, Job,
    ListDeliveriesRequest,
};
use tokio::net::TcpListener;

use super::calls::asking;
use super::harness::{Server, key_spec, soon};
use crate::access::Scope;
use crate::hooks::tests::{Receiver, loose, poster};
use crate::ledger::Busy;
use crate::service::clock::now;
use crate::service::{Limits, clock};
use crate::tasks::deliveries::deliveries;

const LEASE: Duration = Duration::from_secs(60);

async fn hook(server: &Server, token: &str, url: String) {
    let hook = Hook { url, ..Hook::default() };
    let mut hooks = HookServiceClient::new(server.channel.clone());
    let request = CreateHookRequest { hook: Some(hook) };
    hooks.create_hook(asking(token, request)).await.unwrap();
}

/// A job that is over.
async fn cancelled(server: &Server, token: &str) {
    let mut jobs = server.jobs.clone();
    let job = Job {
        spec: Some(key_spec(8)),
        ..Job::default()
    };
    let request = CreateJobRequest {
        job: Some(job),
        request_id: String::new(),
    };
    let name = jobs.create_job(asking(token, request)).await.unwrap().into_inner().name;
    jobs.cancel_job(asking(token, CancelJobRequest { name })).await.unwrap();
}

/// A project with many hooks that never answer has few of the slots in which messages are sent.
#[tokio::test]
async fn slow_hooks_of_a_project_do_not_hold_up_those_of_others() {
    let server = Server::with_tokens_and(Limits {
        hooks: loose(),
        ..Limits::default()
    })
    .await;
    let scopes = [Scope::Admin, Scope::Embed];
    let (slow, quick) = (
        server.token("slow", &scopes).await,
        server.token("quick", &scopes).await,
    );
    // Connections are made by the system, and nobody ever answers.
    let silent = TcpListener::bind("127.0.0.1:0").await.unwrap();
    for i in 0..40 {
        hook(&server, &slow, format!("http://{}/{i}", silent.local_addr().unwrap())).await;
    }
    let receiver = Receiver::start().await;
    hook(&server, &quick, format!("http://{}/", receiver.address)).await;
    cancelled(&server, &slow).await;
    let sender = tokio::spawn(deliveries(server.api.clone(), poster(loose())));
    // All slots are taken that the slow ones may have.
    let claimed = async || {
        let list = ListDeliveriesRequest::default();
        let mut hooks = HookServiceClient::new(server.channel.clone());
        let all = hooks.list_deliveries(asking(&slow, list)).await.unwrap().into_inner();
        all.deliveries.iter().filter(|delivery| delivery.attempts > 0).count()
    };
    soon("slow messages", async || claimed().await >= 8).await;
    cancelled(&server, &quick).await;
    soon("the quick message", async || !receiver.received().is_empty()).await;
    assert!(claimed().await < 32);
    server.api.stop();
    sender.await.unwrap();
}

/// What a receiver is sent again is what it was sent before, whatever has become of the job's artifacts meanwhile.
#[tokio::test]
async fn a_message_stays_the_same_when_its_artifacts_go() {
    let server = Server::with(Limits {
        hooks: loose(),
        ..Limits::default()
    })
    .await;
    let receiver = Receiver::start().await;
    let key = server.key(64, b"the key file").await;
    hook(&server, "", format!("http://{}/", receiver.address)).await;
    let scene = server.upload("scene.ply", b"a scene").await.name;
    let spec = EmbedSpec {
        scene,
        key,
        message: "5ec2e75ec2e75ec2".into(),
        ..EmbedSpec::default()
    };
    server.create(Spec::Embed(spec)).await;
    let (job, token) = server.take().await;
    let marked = server.stored(&job.name, &token, b"the marked scene", false).await;
    let result = EmbedResult {
        scene: marked.clone(),
        comparison: server.stored(&job.name, &token, b"a picture", false).await,
        message: "5ec2e75ec2e75ec2".into(),
        ..EmbedResult::default()
    };
    server
        .complete(&job.name, &token, Output::EmbedResult(result))
        .await
        .unwrap();
    let poster = poster(loose());
    let send = async |time| {
        let due = server.ledger().claim_delivery(&Busy::default(), LEASE, time).await;
        server
            .api
            .deliver(&poster, due.unwrap().expect("it is due"), time)
            .await;
    };
    receiver.answer(&[500, 500]);
    send(now()).await;
    let delete = DeleteArtifactRequest { name: marked };
    server.artifacts.clone().delete_artifact(delete).await.unwrap();
    for _ in 0..2 {
        let list = ListDeliveriesRequest {
            state: State::Pending.into(),
            ..ListDeliveriesRequest::default()
        };
        let mut hooks = HookServiceClient::new(server.channel.clone());
        let waiting = hooks.list_deliveries(list).await.unwrap().into_inner().deliveries;
        send(clock::micros_of(waiting[0].next_attempt_time.as_ref().unwrap()).unwrap()).await;
    }
    let received = receiver.received();
    assert_eq!(received.len(), 3);
    assert!(received.iter().all(|one| one.body == received[0].body));
}
