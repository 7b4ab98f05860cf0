//! Counts and traces calls: which, how they ended, how long until they were answered, and which were refused. The
//! outermost layer, so that it sees what other layers refuse too.
use std::convert::Infallible;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Instant;

use futures::future::BoxFuture;
use http_body_util::BodyExt as _;
use tonic::body::Body;
use tonic::codegen::http::{HeaderMap, Request, Response};
use tonic::{Code, Status};
use tonic_types::StatusExt;
use tower::{Layer, Service};
use tracing::Instrument as _;

use crate::metrics::{self, Metrics};
use crate::traces::{self, Span, Traces};

/// The header that says what a call is a part of.
const TRACE_PARENT: &str = "traceparent";

/// What a call is a part of, in its extensions: the call's own span where there is one, else what the caller said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TraceParent(pub String);

/// What a call that has come in is a part of.
pub fn trace_parent<T>(request: &tonic::Request<T>) -> Option<String> {
    let parent = request.extensions().get::<TraceParent>();
    parent.map(|TraceParent(text)| text.clone())
}

/// Counts and traces what passes.
#[derive(Clone, Debug)]
pub struct Measured {
    pub(crate) metrics: Arc<Metrics>,
    pub(crate) traces: Traces,
}

impl<S> Layer<S> for Measured {
    type Service = Counted<S>;

    fn layer(&self, inner: S) -> Counted<S> {
        Counted {
            inner,
            measured: self.clone(),
        }
    }
}

/// A service whose calls are counted.
#[derive(Clone, Debug)]
pub struct Counted<S> {
    inner: S,
    measured: Measured,
}

/// A call that is under way. One whose answer is dropped before its end was given up by whoever made it.
struct UnderWay {
    method: &'static str,
    metrics: Arc<Metrics>,
    span: Option<Span>,
    over: bool,
}

impl UnderWay {
    fn end(&mut self, how: Code) {
        if std::mem::replace(&mut self.over, true) {
            return;
        }
        self.metrics.call(self.method, how);
        // A caller's mistake is no failure of the server's.
        let failed = matches!(
            how,
            Code::Unknown | Code::DeadlineExceeded | Code::Internal | Code::Unavailable | Code::DataLoss
        );
        traces::note(&mut self.span, "rpc.grpc.status", metrics::code(how), failed);
        self.span = None;
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        self.end(Code::Cancelled);
    }
}

impl<S, B> Service<Request<B>> for Counted<S>
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

    fn call(&mut self, mut request: Request<B>) -> Self::Future {
        let begun = Instant::now();
        let method = metrics::method(request.uri().path());
        let Measured { metrics, traces } = self.measured.clone();
        let said = request.headers().get(TRACE_PARENT).and_then(|text| text.to_str().ok());
        let parent = said.and_then(traces::parse);
        let span = traces.call(method, parent.as_ref());
        let context = span.as_ref().map(traces::context).or(parent.as_ref());
        // So that lines of the log can be found by the trace.
        let log = match context {
            Some(context) => tracing::info_span!("call", method, trace = %context.trace_id()),
            None => tracing::Span::none(),
        };
        if let Some(context) = context {
            let parent = TraceParent(traces::text(context));
            request.extensions_mut().insert(parent);
        }
        let answer = self.inner.call(request);
        let mut call = UnderWay {
            method,
            metrics: metrics.clone(),
            span,
            over: false,
        };
        let answered = async move {
            let answer = answer.await?;
            metrics.answered(method, begun.elapsed());
            // An error that comes before any message stands in the headers.
            if let Some(status) = Status::from_header_map(answer.headers()) {
                if let Some(info) = status.get_details_error_info() {
                    metrics.refused(&info.reason);
                }
                call.end(status.code());
                return Ok(answer);
            }
            Ok(answer.map(|body| {
                Body::new(body.map_frame(move |frame| {
                    if let Some(trailers) = frame.trailers_ref() {
                        call.end(code(trailers));
                    }
                    frame
                }))
            }))
        };
        Box::pin(answered.instrument(log))
    }
}

fn code(trailers: &HeaderMap) -> Code {
    Status::from_header_map(trailers).map_or(Code::Unknown, |status| status.code())
}
