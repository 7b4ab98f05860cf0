//! The C2PA's Soft Binding Resolution API over HTTP: questions with a token, answered for the token's project.
use std::time::Duration;

use guardsplat_soft_binding::resolution::{self, MAX_BODY, Question, Refusal, TEXT};
use http_body_util::{BodyExt as _, Full, Limited};
use hyper::body::Bytes;
use tokio::time::timeout;
use tonic::body::Body;
use tonic::codegen::http::header::{CACHE_CONTROL, CONTENT_TYPE, HeaderValue, RETRY_AFTER, WWW_AUTHENTICATE};
use tonic::codegen::http::{Request, Response, StatusCode};
use tonic::{Code, Status};
use tonic_types::StatusExt as _;

use crate::error::{Error, Result};
use crate::grpc::guard::Guard;
use crate::service::Service;
use crate::service::resolution::Answer;

/// How long a question and its answer may take.
const LIMIT: Duration = Duration::from_secs(30);

/// What answers, and who may ask.
#[derive(Clone)]
pub struct Resolution {
    /// What knows of credentials.
    pub api: Service,
    /// Who may ask.
    pub guard: Guard,
}

impl Resolution {
    /// Answers a question.
    pub async fn answer(self, request: Request<Body>) -> Response<Body> {
        let answered = timeout(LIMIT, self.found(request)).await;
        let mut answer = match answered.unwrap_or(Err(Error::DeadlineExceeded)) {
            Ok(Answer::Found(kind, bytes)) => response(StatusCode::OK, kind, bytes),
            Ok(Answer::Refused(refusal)) => refused(&refusal),
            Err(error) => failed(&Status::from(error)),
        };
        // What a project has is in no cache.
        let headers = answer.headers_mut();
        headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
        answer
    }

    async fn found(self, request: Request<Body>) -> Result<Answer> {
        let (head, body) = request.into_parts();
        let caller = self.guard.admit_to_resolve(&head).await?;
        let (path, query) = (head.uri.path(), head.uri.query().unwrap_or_default());
        // Scenes are not read here, so how long they are does not matter.
        let body = match path {
            resolution::BY_CONTENT_PATH => Bytes::new(),
            _ => match Limited::new(body, MAX_BODY).collect().await {
                Ok(body) => body.to_bytes(),
                Err(_) => {
                    let told = format!("a question has at most {MAX_BODY} bytes");
                    return Ok(Answer::Refused(Refusal { status: 413, told }));
                }
            },
        };
        let question = match resolution::parse(head.method.as_str(), path, query, &body) {
            Ok(question) => question,
            Err(refusal) => return Ok(Answer::Refused(refusal)),
        };
        match (caller, question) {
            (Some(caller), question) => self.api.resolve(&caller.project, question).await,
            // What can be read says nothing of anybody.
            (None, Question::Algorithms) => self.api.resolve("", Question::Algorithms).await,
            (None, _) => Err(Error::TokenMissing),
        }
    }
}

fn response(status: StatusCode, kind: &'static str, bytes: Bytes) -> Response<Body> {
    let mut response = Response::new(Body::new(Full::new(bytes)));
    *response.status_mut() = status;
    response
        .headers_mut()
        .insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    response
}

fn refused(refusal: &Refusal) -> Response<Body> {
    let status = StatusCode::from_u16(refusal.status).unwrap_or(StatusCode::BAD_REQUEST);
    response(status, TEXT, format!("{}\n", refusal.told).into())
}

/// An error in the words of HTTP.
fn failed(status: &Status) -> Response<Body> {
    let code = match status.code() {
        Code::Unauthenticated => StatusCode::UNAUTHORIZED,
        Code::PermissionDenied => StatusCode::FORBIDDEN,
        Code::NotFound | Code::Unimplemented => StatusCode::NOT_FOUND,
        Code::ResourceExhausted => StatusCode::TOO_MANY_REQUESTS,
        Code::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
        Code::DeadlineExceeded => StatusCode::GATEWAY_TIMEOUT,
        _ => StatusCode::INTERNAL_SERVER_ERROR,
    };
    let mut answer = response(code, TEXT, format!("{}\n", status.message()).into());
    let headers = answer.headers_mut();
    if code == StatusCode::UNAUTHORIZED {
        headers.insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
    }
    let pause = status.get_details_retry_info().and_then(|retry| retry.retry_delay);
    if let Some(pause) = pause {
        headers.insert(RETRY_AFTER, HeaderValue::from(pause.as_secs().max(1)));
    }
    answer
}
