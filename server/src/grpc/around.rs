//! A layer around every call: what looks at the head of a request and does something with the answer.
use std::convert::Infallible;
use std::task::{Context, Poll};

use futures::future::BoxFuture;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tower::{Layer, Service};

/// An answer that is on its way.
pub(crate) type Answer = BoxFuture<'static, Result<Response<Body>, Infallible>>;

/// What a layer does with the answer to a request; of the request it sees everything but the body.
pub(crate) trait AroundCall: Clone {
    /// The answer that the caller gets in place of `answer`.
    fn around<B>(&self, request: &Request<B>) -> impl FnOnce(Answer) -> Answer + 'static;
}

/// Makes a layer of an [`AroundCall`].
#[derive(Clone, Copy, Debug)]
pub struct Around<A>(pub(crate) A);

impl<A: Clone, S> Layer<S> for Around<A> {
    type Service = Surrounded<A, S>;

    fn layer(&self, inner: S) -> Surrounded<A, S> {
        let around = self.0.clone();
        Surrounded { around, inner }
    }
}

/// A service whose answers go through an [`AroundCall`].
#[derive(Clone, Debug)]
pub struct Surrounded<A, S> {
    around: A,
    inner: S,
}

impl<A, S, B> Service<Request<B>> for Surrounded<A, S>
where
    A: AroundCall,
    S: Service<Request<B>, Response = Response<Body>, Error = Infallible>,
    S::Future: Send + 'static,
{
    type Response = Response<Body>;
    type Error = Infallible;
    type Future = Answer;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let around = self.around.around(&request);
        around(Box::pin(self.inner.call(request)))
    }
}
