//! Every call there is, with every kind of token that is not enough, and with those that are.
use std::collections::BTreeSet;

use guardsplat_proto::v1::token::Scope as Wire;
use guardsplat_proto::v1::token_service_client::TokenServiceClient;
use guardsplat_proto::v1::{CreateTokenRequest, ListTokensRequest, RevokeTokenRequest, Token};
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tonic::{Code, Status};
use tower::{Layer, ServiceExt, service_fn};

use super::calls::{asking, call, paths};
use super::harness::{Server, invalid, not_found, refused, soon};
use crate::access::Scope::{Admin, Embed, Verify, Worker};
use crate::access::{self, METHODS, Need, Scope};
use crate::grpc::guard::Guard;

/// Whether a call got past the guard; what the service makes of an empty message does not matter here.
fn came_in(answer: &Result<Option<Vec<u8>>, Status>) -> bool {
    let kept_out = [Code::Unauthenticated, Code::PermissionDenied, Code::Unimplemented];
    !matches!(answer, Err(status) if kept_out.contains(&status.code()))
}

/// The need of a call. A call that was added to the API fails here until somebody says who may make it.
fn need(path: &str) -> Need {
    access::need(path).unwrap_or_else(|| panic!("{path} has no line in access::METHODS: say who may call it"))
}

#[tokio::test]
async fn every_call_refuses_tokens_that_are_not_good_for_it() {
    let server = Server::with_tokens().await;
    let expired = server.token_until("studio", &Scope::ALL, Some(1)).await;
    let revoked = server.token("studio", &Scope::ALL).await;
    server.ledger().revoke_token(id(&revoked), 1).await.unwrap();
    let bad = [
        (None, "TOKEN_MISSING"),
        (Some("gst_0_0"), "TOKEN_UNKNOWN"),
        (Some(""), "TOKEN_UNKNOWN"),
        (Some(expired.as_str()), "TOKEN_EXPIRED"),
        (Some(revoked.as_str()), "TOKEN_REVOKED"),
    ];
    let mut checked = 0;
    for path in paths() {
        let need = need(&path);
        for (token, reason) in bad {
            let answer = call(&server.channel, &path, token, Vec::new()).await;
            checked += 1;
            if need == Need::Nothing {
                assert!(came_in(&answer), "{path}: {answer:?}");
            } else {
                assert!(!came_in(&answer), "{path} with {token:?}");
                refused(answer, Code::Unauthenticated, reason);
            }
        }
        let enough: &[Scope] = match need {
            Need::Nothing => continue,
            Need::Token => &Scope::ALL,
            Need::AnyOf(scopes) => scopes,
        };
        let others: Vec<Scope> = Scope::ALL.into_iter().filter(|scope| !enough.contains(scope)).collect();
        if !others.is_empty() {
            let token = server.token("studio", &others).await;
            let answer = call(&server.channel, &path, Some(&token), Vec::new()).await;
            let details = refused(answer, Code::PermissionDenied, "SCOPE_MISSING");
            let words: Vec<_> = enough.iter().map(|scope| scope.word()).collect();
            assert_eq!(
                details.error_info().unwrap().metadata["scopes"],
                words.join(","),
                "{path}"
            );
        }
        for &scope in enough {
            let token = server.token("studio", &[scope]).await;
            let answer = call(&server.channel, &path, Some(&token), Vec::new()).await;
            assert!(came_in(&answer), "{path} with {scope:?}: {answer:?}");
        }
    }
    assert!(checked > 150, "{checked}");
}

#[test]
fn the_table_has_the_calls_there_are() {
    let there: BTreeSet<String> = paths().into_iter().collect();
    let listed: Vec<&str> = METHODS.iter().map(|(path, _)| *path).collect();
    for path in &listed {
        assert!(there.contains(*path), "{path} is in the table, and is no call");
    }
    assert_eq!(
        listed.len(),
        listed.iter().collect::<BTreeSet<_>>().len(),
        "a call twice"
    );
    for path in &there {
        need(path);
    }
    // What only those may do who look after the project, or work for all.
    for (path, need) in METHODS {
        if path.contains("TokenService") || path.contains("HookService") {
            assert_eq!(*need, Need::AnyOf(&[Admin]), "{path}");
        }
        if path.contains("WorkerService") {
            assert_eq!(*need, Need::AnyOf(&[Worker]), "{path}");
        }
    }
}

/// A call that is in a service, and not in the table, does not reach it.
#[tokio::test]
async fn a_call_that_nobody_thought_of_is_refused() {
    let server = Server::with_tokens().await;
    let token = server.token("studio", &Scope::ALL).await;
    for guard in [
        Guard::open(server.api.meter()),
        Guard::tokens(server.api.meter(), server.ledger(), None),
    ] {
        let inner = service_fn(|_: Request<Body>| async {
            panic!("came in");
            #[allow(unreachable_code)]
            Ok::<_, std::convert::Infallible>(Response::new(Body::empty()))
        });
        let request = Request::post("/guardsplat.v1.JobService/PurgeJobs")
            .header("authorization", format!("bearer {token}"))
            .body(Body::empty());
        let answer = guard.layer(inner).oneshot(request.unwrap()).await.unwrap();
        let status = Status::from_header_map(answer.headers()).unwrap();
        refused(Err::<(), _>(status), Code::Unimplemented, "UNIMPLEMENTED");
    }
    let answer = call(&server.channel, "/guardsplat.v1.JobService/PurgeJobs", None, Vec::new()).await;
    refused(answer, Code::Unauthenticated, "TOKEN_MISSING");
}

#[tokio::test]
async fn the_use_of_a_token_is_seen() {
    let server = Server::with_tokens().await;
    let token = server.token("studio", &[Verify]).await;
    let used = async || {
        server
            .ledger()
            .get_token(id(&token))
            .await
            .unwrap()
            .unwrap()
            .last_use_time
    };
    assert_eq!(used().await, None);
    call(
        &server.channel,
        "/guardsplat.v1.JobService/ListJobs",
        Some(&token),
        Vec::new(),
    )
    .await
    .unwrap();
    soon("the note", async || used().await.is_some()).await;
}

/// The id in a token's text.
fn id(token: &str) -> uuid::Uuid {
    token.split('_').nth(1).unwrap().parse().unwrap()
}

fn new_token(scopes: &[Wire]) -> CreateTokenRequest {
    let token = Token {
        display_name: "the shop".into(),
        scopes: scopes.iter().map(|&scope| scope.into()).collect(),
        ..Token::default()
    };
    CreateTokenRequest { token: Some(token) }
}

#[tokio::test]
async fn tokens_are_made_listed_and_revoked_by_their_project() {
    let server = Server::with_tokens().await;
    let admin = server.token("studio", &[Admin]).await;
    let stranger = server.token("other", &[Admin]).await;
    let mut tokens = TokenServiceClient::new(server.channel.clone());

    let made = tokens
        .create_token(asking(&admin, new_token(&[Wire::Verify, Wire::Embed])))
        .await;
    let made = made.unwrap().into_inner();
    let token = made.token.unwrap();
    assert_eq!(
        (token.project.as_str(), token.display_name.as_str()),
        ("studio", "the shop")
    );
    assert_eq!(token.scopes, [Wire::Embed as i32, Wire::Verify as i32]);
    let jobs = "/guardsplat.v1.JobService/ListJobs";
    call(&server.channel, jobs, Some(&made.secret), Vec::new())
        .await
        .unwrap();

    let mut listed = async |by: &str| {
        let answer = tokens.list_tokens(asking(by, ListTokensRequest::default())).await;
        let tokens = answer.unwrap().into_inner().tokens;
        tokens.into_iter().map(|token| token.name).collect::<Vec<_>>()
    };
    assert_eq!(
        listed(&admin).await,
        [token.name.clone(), format!("tokens/{}", id(&admin))]
    );
    assert_eq!(listed(&stranger).await, [format!("tokens/{}", id(&stranger))]);

    let revoke = RevokeTokenRequest {
        name: token.name.clone(),
    };
    let answer = tokens.revoke_token(asking(&stranger, revoke.clone())).await;
    assert_eq!(not_found(answer), token.name);
    call(&server.channel, jobs, Some(&made.secret), Vec::new())
        .await
        .unwrap();
    let revoked = tokens.revoke_token(asking(&admin, revoke)).await.unwrap().into_inner();
    assert!(revoked.revoke_time.is_some());
    let answer = call(&server.channel, jobs, Some(&made.secret), Vec::new()).await;
    refused(answer, Code::Unauthenticated, "TOKEN_REVOKED");
}

#[tokio::test]
async fn a_token_must_make_sense() {
    let server = Server::with_tokens().await;
    let admin = server.token("studio", &[Admin, Embed]).await;
    let mut tokens = TokenServiceClient::new(server.channel.clone());
    let mut fields = async |request: CreateTokenRequest| invalid(tokens.create_token(asking(&admin, request)).await);
    assert_eq!(fields(CreateTokenRequest::default()).await, ["token"]);
    assert_eq!(fields(new_token(&[])).await, ["token.scopes"]);
    // A worker sees what all projects send.
    assert_eq!(
        fields(new_token(&[Wire::Embed, Wire::Worker])).await,
        ["token.scopes[1]"]
    );
    assert_eq!(fields(new_token(&[Wire::Unspecified])).await, ["token.scopes[0]"]);
    let mut all_wrong = new_token(&[Wire::Embed]);
    let token = all_wrong.token.as_mut().unwrap();
    token.project = "other".into();
    token.display_name = "x".repeat(64);
    token.expire_time = Some(prost_types::Timestamp { seconds: 1, nanos: 0 });
    assert_eq!(
        fields(all_wrong).await,
        ["token.display_name", "token.expire_time", "token.project"]
    );
}
