//! The page for browsers: files that are compiled in, which anybody may have, and the calls of the API as gRPC-Web, which
//! go through the same guard as all others. Beside them the resolution API of content credentials, for programs.
mod files;
mod resolution;
#[cfg(test)]
mod tests;

use std::convert::Infallible;
use std::task::{Context, Poll};
use std::time::Duration;

use futures::future::{BoxFuture, Either, FutureExt as _, Ready, ready};
use guardsplat_soft_binding::resolution::is_of_api;
use http_body_util::{BodyStream, StreamBody};
use tokio_stream::StreamExt as _;
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::header::{ALLOW, CACHE_CONTROL, HeaderName, HeaderValue};
use tonic::codegen::http::{Method, Request, Response, StatusCode};
use tonic_web::{GrpcWebLayer, GrpcWebService};
use tower::{Layer, Service};

/// Services whose calls browsers may make. What only workers and operators' programs call is not among them.
const SERVICES: [&str; 4] = [
    "/guardsplat.v1.ArtifactService/",
    "/guardsplat.v1.JobService/",
    "/guardsplat.v1.KeyService/",
    "/guardsplat.v1.RegistryService/",
];

/// How long nothing of a request may arrive. HTTP/1.1 has no way to ask whether whoever sends it is still there.
const SILENCE: Duration = Duration::from_secs(60);

/// What goes with every answer. Scripts and styles are files of the page; the viewer compiles WebAssembly, which it has as
/// a `data:` URL, and sorts in workers that it has as `blob:`. Pictures are those that the page has fetched with a token.
const HEADERS: [(&str, &str); 6] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' blob:; \
         connect-src 'self' data: blob:; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; \
         frame-ancestors 'none'",
    ),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("permissions-policy", "camera=(), geolocation=(), microphone=()"),
    ("referrer-policy", "no-referrer"),
    ("x-content-type-options", "nosniff"),
];

pub use resolution::Resolution;

/// Puts the page, the translation from gRPC-Web, and the resolution API before the API.
#[derive(Clone)]
pub struct PageLayer {
    web: GrpcWebLayer,
    resolution: Resolution,
}

impl PageLayer {
    /// One that resolves so.
    pub fn new(resolution: Resolution) -> Self {
        Self {
            web: GrpcWebLayer::new(),
            resolution,
        }
    }
}

impl<S> Layer<S> for PageLayer {
    type Service = PageService<GrpcWebService<S>>;

    fn layer(&self, inner: S) -> Self::Service {
        PageService {
            calls: self.web.layer(inner),
            resolution: self.resolution.clone(),
        }
    }
}

/// Answers with files, and hands calls on.
#[derive(Clone)]
pub struct PageService<S> {
    calls: S,
    resolution: Resolution,
}

type Answer = Result<Response<Body>, Infallible>;

impl<S> Service<Request<Body>> for PageService<S>
where
    S: Service<Request<Body>, Response = Response<Body>, Error = Infallible>,
    S::Future: Send + 'static,
{
    type Response = Response<Body>;
    type Error = Infallible;
    type Future = Either<Ready<Answer>, BoxFuture<'static, Answer>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        self.calls.poll_ready(context)
    }

    fn call(&mut self, request: Request<Body>) -> Self::Future {
        let path = request.uri().path();
        if is_of_api(path) {
            let answer = self
                .resolution
                .clone()
                .answer(request.map(|body| timely(body, SILENCE)));
            return Either::Right(async move { Ok(with_headers(answer.await)) }.boxed());
        }
        if !SERVICES.iter().any(|service| path.starts_with(service)) {
            return Either::Left(ready(Ok(with_headers(file(&request)))));
        }
        let answer = self.calls.call(request.map(|body| timely(body, SILENCE)));
        let answer = async move {
            let mut answer = answer.await?;
            // What a project has is in no cache.
            answer
                .headers_mut()
                .insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
            Ok(with_headers(answer))
        };
        Either::Right(answer.boxed())
    }
}

/// A request that fails when nothing of it arrives for so long.
fn timely(body: Body, silence: Duration) -> Body {
    let frames = BodyStream::new(body).timeout(silence);
    Body::new(StreamBody::new(frames.map(|frame| {
        frame.unwrap_or_else(|_| Err(Status::aborted("nothing of the request arrived for too long")))
    })))
}

fn file<B>(request: &Request<B>) -> Response<Body> {
    match (files::find(request.uri().path()), request.method()) {
        (None, _) => empty(StatusCode::NOT_FOUND),
        (Some(file), &Method::GET | &Method::HEAD) => file.answer(request.headers()),
        (Some(_), _) => {
            let mut refusal = empty(StatusCode::METHOD_NOT_ALLOWED);
            let methods = HeaderValue::from_static("GET, HEAD");
            refusal.headers_mut().insert(ALLOW, methods);
            refusal
        }
    }
}

fn empty(status: StatusCode) -> Response<Body> {
    let mut answer = Response::new(Body::empty());
    *answer.status_mut() = status;
    answer
}

fn with_headers(mut answer: Response<Body>) -> Response<Body> {
    let headers = HEADERS.map(|(name, value)| (HeaderName::from_static(name), HeaderValue::from_static(value)));
    answer.headers_mut().extend(headers);
    answer
}
