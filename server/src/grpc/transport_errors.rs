//! Errors that arise before a call reaches its service, such as a message that is too large or a call that there is
//! not: tonic answers them with a code and a text, and here they get the `google.rpc` details that all others have.
use std::collections::HashMap;
use std::convert::Infallible;
use std::task::{Context, Poll};

use futures::future::BoxFuture;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};
use tower::{Layer, Service};

use crate::grpc::status::DOMAIN;

/// What the paths of this API begin with; health and reflection are as they are everywhere.
const OURS: &str = "/guardsplat.";

/// Adds details to errors that have none.
#[derive(Clone, Copy, Debug)]
pub struct Explained;

impl<S> Layer<S> for Explained {
    type Service = WithDetails<S>;

    fn layer(&self, inner: S) -> WithDetails<S> {
        WithDetails { inner }
    }
}

/// A service whose errors have details.
#[derive(Clone, Debug)]
pub struct WithDetails<S> {
    inner: S,
}

impl<S, B> Service<Request<B>> for WithDetails<S>
where
    S: Service<Request<B>, Response = Response<Body>, Error = Infallible>,
    S::Future: Send + 'static,
{
    type Response = Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<'static, Result<Response<Body>, Infallible>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let ours = request.uri().path().starts_with(OURS);
        let answer = self.inner.call(request);
        Box::pin(async move {
            let mut answer = answer.await?;
            // An error that comes before any message stands in the headers.
            if ours && let Some(status) = Status::from_header_map(answer.headers()).and_then(explain) {
                // It fails for texts that are no header; this one was read from there.
                let _ = status.add_header(answer.headers_mut());
            }
            Ok(answer)
        })
    }
}

/// The same error with details, if it has none.
fn explain(status: Status) -> Option<Status> {
    if status.code() == Code::Ok || !status.details().is_empty() {
        return None;
    }
    let details = ErrorDetails::with_error_info(reason(status.code()), DOMAIN, HashMap::new());
    let text = match (status.code(), status.message()) {
        (Code::Unimplemented, "") => "there is no such call; reflection tells which there are",
        (_, text) => text,
    };
    Some(Status::with_error_details(status.code(), text, details))
}

fn reason(code: Code) -> &'static str {
    match code {
        Code::OutOfRange => "MESSAGE_TOO_LARGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        _ => "BAD_MESSAGE",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bare_errors_get_details() {
        let told = explain(Status::out_of_range("too large")).unwrap();
        assert_eq!((told.code(), told.message()), (Code::OutOfRange, "too large"));
        let info = told.get_details_error_info().unwrap();
        assert_eq!(
            (info.reason.as_str(), info.domain.as_str()),
            ("MESSAGE_TOO_LARGE", DOMAIN)
        );
        assert!(explain(told).is_none());
        assert!(explain(Status::ok("")).is_none());
    }

    #[test]
    fn reasons_are_documented() {
        let page = include_str!("../../../docs/api.md");
        for code in [Code::OutOfRange, Code::Unimplemented, Code::Internal] {
            assert!(page.contains(&format!("`{}`", reason(code))), "{code}");
        }
    }
}
