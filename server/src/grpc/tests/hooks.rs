//! Hooks the whole way: from a job that is over to a message that is acknowledged, with receivers that fail, servers that
//! stop, and several servers.
use std::sync::Arc;
use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::delivery::State;
use guardsplat_proto::v1::hook::Kind;
use guardsplat_proto::v1::hook_service_client::HookServiceClient;
use guardsplat_proto::v1::job::{self, Spec};
use guardsplat_proto::v1::{
    CancelJobRequest, CreateHookRequest, DeleteHookRequest, Delivery, EmbedResult, EmbedSpec, GetHookRequest, Hook,
    Job, ListDeliveriesRequest, ListHooksRequest, RedeliverDeliveryRequest,
};
use serde_json::Value;
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tonic::Code;
use tonic::transport::Channel;
use uuid::Uuid;

use super::calls::asking;
use super::harness::{Server, invalid, key_spec, not_found, refused, sha256, soon};
use crate::access::Scope;
use crate::hooks::tests::{Received, Receiver, loose, poster};
use crate::hooks::{Poster, Rules, signature};
use crate::ledger::postgres::tests::Place;
use crate::ledger::{Busy, Ledger, SqliteLedger};
use crate::service::clock::now;
use crate::service::{Limits, clock};
use crate::tasks::deliveries::deliveries;

/// How long claims of these tests hold.
const LEASE: Duration = Duration::from_secs(60);
const SECOND: i64 = 1_000_000;
/// What a scene is marked with.
const MESSAGE: &str = "5ec2e75ec2e75ec2";

fn limits() -> Limits {
    Limits {
        hooks: loose(),
        ..Limits::default()
    }
}

/// A hook for everything, and its secret.
async fn hook(channel: &Channel, url: &str) -> (String, Vec<u8>) {
    let hook = Hook {
        url: url.into(),
        ..Hook::default()
    };
    let made = HookServiceClient::new(channel.clone())
        .create_hook(CreateHookRequest { hook: Some(hook) })
        .await
        .unwrap()
        .into_inner();
    let secret = made.secret.strip_prefix("whsec_").unwrap();
    (made.hook.unwrap().name, STANDARD.decode(secret).unwrap())
}

async fn listed(server: &Server, state: State) -> Vec<Delivery> {
    let request = ListDeliveriesRequest {
        state: state.into(),
        ..ListDeliveriesRequest::default()
    };
    let mut hooks = HookServiceClient::new(server.channel.clone());
    hooks.list_deliveries(request).await.unwrap().into_inner().deliveries
}

/// Sends all that is due at a time, and says how many that were.
async fn send_due(server: &Server, poster: &Poster, now: i64) -> usize {
    let mut count = 0;
    while let Some(sending) = server
        .ledger()
        .claim_delivery(&Busy::default(), LEASE, now)
        .await
        .unwrap()
    {
        server.api.deliver(poster, sending, now).await;
        count += 1;
    }
    count
}

/// The event in a message whose signature is right.
#[track_caller]
fn event(received: &Received, secret: &[u8]) -> Value {
    let (id, timestamp) = (received.header("webhook-id"), received.header("webhook-timestamp"));
    let signed = signature::sign(secret, &id, timestamp.parse().unwrap(), &received.body).unwrap();
    assert_eq!(received.header("webhook-signature"), signed);
    assert!(
        received
            .header("content-type")
            .starts_with("application/cloudevents+json")
    );
    let event: Value = serde_json::from_slice(&received.body).unwrap();
    assert_eq!(event["id"], id);
    event
}

async fn cancelled(server: &Server) -> String {
    let name = server.create(key_spec(8)).await.name;
    let request = CancelJobRequest { name: name.clone() };
    server.jobs.clone().cancel_job(request).await.unwrap();
    name
}

/// What a marketplace does: uploads, asks for a mark under a name of its own, and is told.
async fn a_marketplace_is_told(ledger: Arc<dyn Ledger>) {
    let server = Server::over(ledger, TempDir::new().unwrap(), limits(), false).await;
    let receiver = Receiver::start().await;
    let key = server.key(64, b"the key file").await;
    let (_, secret) = hook(&server.channel, &format!("http://{}/hook", receiver.address)).await;
    let scene = server.upload("scene.ply", b"a scene").await.name;
    let request_id = Uuid::new_v4().to_string();
    let wanted = Job {
        display_name: "asset 7".into(),
        spec: Some(Spec::Embed(EmbedSpec {
            scene,
            key: key.clone(),
            message: MESSAGE.into(),
            ..EmbedSpec::default()
        })),
        ..Job::default()
    };
    let made = server.submit(wanted.clone(), &request_id).await.unwrap().into_inner();
    let again = server.submit(wanted, &request_id).await.unwrap().into_inner();
    assert_eq!(again.name, made.name);
    let (job, token) = server.take().await;
    let marked = server.stored(&job.name, &token, b"the marked scene", false).await;
    let picture = server.stored(&job.name, &token, b"a picture", false).await;
    let result = EmbedResult {
        scene: marked.clone(),
        comparison: picture,
        bit_accuracy: 0.975,
        message: MESSAGE.into(),
        message_recovered: true,
        psnr_db: Some(36.5),
        ..EmbedResult::default()
    };
    let poster = poster(loose());
    assert_eq!(send_due(&server, &poster, now()).await, 0, "nothing is over yet");
    server
        .complete(&job.name, &token, Output::EmbedResult(result))
        .await
        .unwrap();

    // It fails twice, and is tried again in its time.
    receiver.answer(&[500, 302]);
    let mut time = now() + SECOND;
    let reasons = ["answered 500", "answered 302, and redirects are not followed"];
    for (attempt, (reason, least)) in (1..).zip(reasons.into_iter().zip([5, 20])) {
        assert_eq!(send_due(&server, &poster, time).await, 1);
        assert_eq!(send_due(&server, &poster, time + (least - 1) * SECOND).await, 0);
        let waiting = listed(&server, State::Pending).await.remove(0);
        assert_eq!((waiting.attempts, waiting.last_error.as_str()), (attempt, reason));
        assert_eq!((waiting.job.as_str(), waiting.end_time), (made.name.as_str(), None));
        time = clock::micros_of(&waiting.next_attempt_time.unwrap()).unwrap();
    }
    assert_eq!(send_due(&server, &poster, time).await, 1);
    assert_eq!(send_due(&server, &poster, time + 9_999 * SECOND).await, 0);
    let done = listed(&server, State::Delivered).await.remove(0);
    assert_eq!((done.attempts, done.last_error.as_str()), (3, ""));

    let received = receiver.received();
    assert_eq!(received.len(), 3);
    assert!(
        received.iter().all(|one| one.body == received[0].body),
        "one event, one text"
    );
    let sent: Vec<i64> = received
        .iter()
        .map(|one| one.header("webhook-timestamp").parse().unwrap())
        .collect();
    assert!(sent[0] < sent[1] && sent[1] < sent[2], "{sent:?}");
    let event = event(&received[2], &secret);
    assert_eq!(done.name, format!("deliveries/{}", event["id"].as_str().unwrap()));
    assert_eq!(
        (event["specversion"].as_str(), event["subject"].as_str()),
        (Some("1.0"), Some(made.name.as_str()))
    );
    assert_eq!(event["type"], "guardsplat.job.succeeded.v1");
    assert_eq!(event["source"], "/guardsplat/projects/default");
    let data = &event["data"];
    assert_eq!(data["request_id"], request_id);
    assert_eq!(
        (&data["job"], &data["kind"]),
        (&Value::from(made.name), &Value::from("embed"))
    );
    assert_eq!(
        (&data["state"], &data["display_name"]),
        (&"succeeded".into(), &"asset 7".into())
    );
    assert_eq!(
        (&data["figures"]["bit_accuracy"], &data["figures"]["psnr_db"]),
        (&0.975.into(), &36.5.into())
    );
    let scene = &data["artifacts"][0];
    assert_eq!((&scene["role"], &scene["name"]), (&"scene".into(), &marked.into()));
    assert_eq!(scene["sha256"], sha256(b"the marked scene"));
    // What it was marked with is nobody's business on the way.
    let text = String::from_utf8(received[2].body.clone()).unwrap();
    assert!(!text.contains(MESSAGE) && !text.contains(&key), "{text}");
}

#[tokio::test]
async fn a_marketplace_is_told_with_sqlite() {
    let folder = TempDir::new().unwrap();
    let ledger = SqliteLedger::open(&folder.path().join("ledger.sqlite")).await.unwrap();
    a_marketplace_is_told(Arc::new(ledger)).await;
}

#[tokio::test]
async fn a_marketplace_is_told_with_postgres() {
    let Some(place) = Place::fresh().await else { return };
    a_marketplace_is_told(place.ledger().await).await;
}

/// The loop that a server runs; it ends with the API.
fn run(server: &Server) -> JoinHandle<()> {
    tokio::spawn(deliveries(server.api.clone(), poster(loose())))
}

#[tokio::test]
async fn what_a_server_did_not_send_is_sent_after_its_restart() {
    let receiver = Receiver::start().await;
    let server = Server::with(limits()).await;
    let (_, secret) = hook(&server.channel, &format!("http://{}/", receiver.address)).await;
    let name = cancelled(&server).await;
    let server = server.restart(limits()).await;
    let sender = run(&server);
    soon("the message", async || !receiver.received().is_empty()).await;
    let event = event(&receiver.received()[0], &secret);
    assert_eq!(
        (&event["subject"], &event["type"]),
        (&name.into(), &"guardsplat.job.cancelled.v1".into())
    );
    assert_eq!(event["data"]["failure_reason"], Value::Null);
    soon("the note", async || !listed(&server, State::Delivered).await.is_empty()).await;
    server.api.stop();
    sender.await.unwrap();
    assert_eq!(receiver.received().len(), 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_servers_tell_of_each_job_once() {
    const JOBS: usize = 12;
    let Some(place) = Place::fresh().await else { return };
    let receiver = Receiver::start().await;
    let one = Server::over(place.ledger().await, TempDir::new().unwrap(), limits(), false).await;
    let two = one.twin(place.ledger().await).await;
    let (_, secret) = hook(&one.channel, &format!("http://{}/", receiver.address)).await;
    let senders = [run(&one), run(&two)];
    let mut expected = Vec::new();
    for i in 0..JOBS {
        expected.push(cancelled(if i % 2 == 0 { &one } else { &two }).await);
    }
    soon("all messages", async || {
        listed(&one, State::Delivered).await.len() == JOBS
    })
    .await;
    for server in [&one, &two] {
        server.api.stop();
    }
    for sender in senders {
        sender.await.unwrap();
    }
    let mut told: Vec<String> = receiver
        .received()
        .iter()
        .map(|one| event(one, &secret)["subject"].as_str().unwrap().to_owned())
        .collect();
    told.sort();
    expected.sort();
    assert_eq!(told, expected);
}

#[tokio::test]
async fn what_is_never_acknowledged_is_given_up_and_can_be_sent_again() {
    let receiver = Receiver::start().await;
    let server = Server::with(limits()).await;
    hook(&server.channel, &format!("http://{}/", receiver.address)).await;
    cancelled(&server).await;
    let poster = poster(loose());
    receiver.answer(&[503, 503]);
    let begin = now() + SECOND;
    assert_eq!(send_due(&server, &poster, begin).await, 1);
    let after = loose().give_up_after;
    assert_eq!(send_due(&server, &poster, begin + clock::micros(after)).await, 1);
    let dead = listed(&server, State::Dead).await.remove(0);
    assert_eq!((dead.attempts, dead.last_error.as_str()), (2, "answered 503"));
    assert!(dead.end_time.is_some() && dead.next_attempt_time.is_none());
    assert_eq!(send_due(&server, &poster, begin + 2 * clock::micros(after)).await, 0);

    let mut hooks = HookServiceClient::new(server.channel.clone());
    let request = RedeliverDeliveryRequest {
        name: dead.name.clone(),
    };
    let again = hooks.redeliver_delivery(request).await.unwrap().into_inner();
    assert_eq!((again.state(), again.attempts), (State::Pending, 0));
    assert_eq!(send_due(&server, &poster, now() + SECOND).await, 1);
    assert_eq!(listed(&server, State::Delivered).await[0].name, dead.name);
    let ids: Vec<_> = receiver.received().iter().map(|one| one.header("webhook-id")).collect();
    assert!(
        ids.iter().all(|id| dead.name.ends_with(id.as_str())) && ids.len() == 3,
        "{ids:?}"
    );
    let unknown = RedeliverDeliveryRequest {
        name: format!("deliveries/{}", Uuid::now_v7()),
    };
    not_found(hooks.redeliver_delivery(unknown).await);
}

#[tokio::test]
async fn a_hook_leads_to_no_private_place() {
    let receiver = Receiver::start().await;
    let strict = Limits {
        hooks: Rules {
            allow_private: false,
            ..loose()
        },
        ..Limits::default()
    };
    let server = Server::with(strict.clone()).await;
    let port = receiver.address.port();
    let mut hooks = HookServiceClient::new(server.channel.clone());
    for host in [
        "127.0.0.1",
        "[::1]",
        "169.254.169.254",
        "10.0.0.1",
        "[::ffff:192.168.0.1]",
    ] {
        let hook = Hook {
            url: format!("http://{host}:{port}/"),
            ..Hook::default()
        };
        let answer = hooks.create_hook(CreateHookRequest { hook: Some(hook) }).await;
        assert_eq!(invalid(answer), ["hook.url"], "{host}");
    }
    // Where a name leads is seen when it is called.
    hook(&server.channel, &format!("http://localhost:{port}/")).await;
    cancelled(&server).await;
    assert_eq!(send_due(&server, &poster(strict.hooks), now() + SECOND).await, 1);
    let waiting = listed(&server, State::Pending).await.remove(0);
    assert!(waiting.last_error.contains("not public"), "{}", waiting.last_error);
    assert!(receiver.received().is_empty());
}

#[tokio::test]
async fn hooks_are_of_a_project_and_tell_their_secret_once() {
    let server = Server::with_tokens().await;
    let [admin, stranger] = [
        server.token("studio", &[Scope::Admin, Scope::Embed]).await,
        server.token("other", &[Scope::Admin]).await,
    ];
    let mut hooks = HookServiceClient::new(server.channel.clone());
    let wanted = Hook {
        display_name: "the shop".into(),
        url: "https://shop.example/hook".into(),
        kinds: vec![Kind::Embed.into()],
        states: vec![job::State::Succeeded.into(), job::State::Failed.into()],
        ..Hook::default()
    };
    let request = CreateHookRequest {
        hook: Some(wanted.clone()),
    };
    let made = hooks.create_hook(asking(&admin, request)).await.unwrap().into_inner();
    let hook = made.hook.unwrap();
    let expected = Hook {
        name: hook.name.clone(),
        project: "studio".into(),
        create_time: hook.create_time,
        ..wanted.clone()
    };
    assert_eq!(hook, expected);
    let secret = STANDARD.decode(made.secret.strip_prefix("whsec_").unwrap()).unwrap();
    assert_eq!(secret.len(), signature::SECRET_BYTES);
    let row = server.ledger().list_hooks("studio", None, 1).await.unwrap().remove(0);
    assert!(!row.sealed_secret.windows(32).any(|window| window == secret), "sealed");

    let name = GetHookRequest {
        name: hook.name.clone(),
    };
    assert_eq!(
        hooks.get_hook(asking(&admin, name.clone())).await.unwrap().into_inner(),
        hook
    );
    assert_eq!(
        not_found(hooks.get_hook(asking(&stranger, name.clone())).await),
        hook.name
    );
    let list = ListHooksRequest::default();
    let own = hooks
        .list_hooks(asking(&admin, list.clone()))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(own.hooks, std::slice::from_ref(&hook));
    assert_eq!(
        hooks
            .list_hooks(asking(&stranger, list))
            .await
            .unwrap()
            .into_inner()
            .hooks,
        []
    );
    let theirs = ListDeliveriesRequest {
        hook: hook.name.clone(),
        ..ListDeliveriesRequest::default()
    };
    assert_eq!(
        not_found(hooks.list_deliveries(asking(&stranger, theirs)).await),
        hook.name
    );

    let mut fields = async |hook: Hook| {
        let request = CreateHookRequest { hook: Some(hook) };
        invalid(hooks.create_hook(asking(&admin, request)).await)
    };
    assert_eq!(fields(Hook::default()).await, ["hook.url"]);
    let wrong = Hook {
        name: "hooks/7".into(),
        display_name: "x".repeat(64),
        url: "http://shop.example/".into(),
        project: "other".into(),
        kinds: vec![0, 1],
        states: vec![job::State::Running.into()],
        create_time: hook.create_time,
    };
    let expected = [
        "hook.display_name",
        "hook.url",
        "hook.kinds[0]",
        "hook.states[0]",
        "hook.name",
        "hook.project",
        "hook.create_time",
    ];
    assert_eq!(fields(wrong).await, expected);

    let delete = DeleteHookRequest { name: hook.name };
    not_found(hooks.delete_hook(asking(&stranger, delete.clone())).await);
    hooks.delete_hook(asking(&admin, delete)).await.unwrap();
    not_found(hooks.get_hook(asking(&admin, name)).await);
    for _ in 0..100 {
        let request = CreateHookRequest {
            hook: Some(wanted.clone()),
        };
        hooks.create_hook(asking(&admin, request)).await.unwrap();
    }
    let request = CreateHookRequest { hook: Some(wanted) };
    let answer = hooks.create_hook(asking(&admin, request)).await;
    refused(answer, Code::ResourceExhausted, "QUOTA_USED_UP");
}
