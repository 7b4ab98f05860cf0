//! Who may come in, and how often: one layer before all services that looks up what a call needs by its path, and who
//! makes it by its token. No service sees a request that has not passed here, and none looks at a token itself.
use std::convert::Infallible;
use std::net::IpAddr;
use std::sync::Arc;
use std::task::{Context, Poll};

use futures::future::BoxFuture;
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http::request::Parts;
use tonic::codegen::http::{Extensions, HeaderMap, Request, Response};
use tonic::transport::server::TcpConnectInfo;
use tower::{Layer, Service};

use crate::access::{self, Caller, Need, Scope};
use crate::error::{Error, Result, chain};
use crate::grpc::token_memory::TokenMemory;
use crate::ledger::{TokenLedger, TokenRow};
use crate::service::clock;
use crate::service::rate_limit::{Class, Meter, Payer, payer};

/// The use of a token is noted so often at most: every note is a write to the ledger.
const NOTE_EVERY: i64 = 60_000_000;
/// How the header begins that has a token; the scheme in any case, as HTTP has it.
const SCHEME: &str = "bearer ";
/// Longest token that is looked at.
const MAX_TOKEN_BYTES: usize = 256;

/// Who may come in.
#[derive(Clone)]
pub struct Guard {
    rule: Rule,
    meter: Arc<Meter>,
}

#[derive(Clone)]
enum Rule {
    /// Anybody, as the one project.
    Open,
    /// The server's own worker, by the hash of its token.
    OwnWorker([u8; 32]),
    /// Whoever shows a token that the ledger knows; and the server's own worker, by the hash of its token.
    Tokens {
        ledger: Arc<dyn TokenLedger>,
        own_worker: Option<[u8; 32]>,
        memory: Arc<TokenMemory>,
    },
}

impl Guard {
    /// One that lets everybody in.
    pub fn open(meter: Arc<Meter>) -> Self {
        Self {
            rule: Rule::Open,
            meter,
        }
    }

    /// One that asks for tokens. `own_worker` is the hash of a token that stands in no ledger, good for a worker.
    pub fn tokens(meter: Arc<Meter>, ledger: Arc<dyn TokenLedger>, own_worker: Option<[u8; 32]>) -> Self {
        Self {
            rule: Rule::Tokens {
                ledger,
                own_worker,
                memory: Arc::default(),
            },
            meter,
        }
    }

    /// One that lets nobody in but a worker with this token.
    pub fn own_worker(meter: Arc<Meter>, hash: [u8; 32]) -> Self {
        Self {
            rule: Rule::OwnWorker(hash),
            meter,
        }
    }

    /// Who makes a call, if they may; none for calls that anybody may make.
    async fn admit(&self, path: &str, headers: &HeaderMap, address: Option<IpAddr>) -> Result<Option<Caller>> {
        self.let_in(access::need(path), path, headers, address).await
    }

    /// Who asks the resolution API, if they may; none for what anybody may ask.
    pub async fn admit_to_resolve(&self, head: &Parts) -> Result<Option<Caller>> {
        let path = head.uri.path();
        let need = access::need_to_resolve(path);
        self.let_in(need, path, &head.headers, address(&head.extensions)).await
    }

    async fn let_in(
        &self,
        need: Option<Need>,
        path: &str,
        headers: &HeaderMap,
        address: Option<IpAddr>,
    ) -> Result<Option<Caller>> {
        if need == Some(Need::Nothing) {
            return Ok(None);
        }
        let caller = self.caller(headers, address).await?;
        if let Some(class) = Class::of(path) {
            self.meter.count(class, &payer(&caller))?;
        }
        match need {
            // Only those who may come in at all hear that there is nothing.
            None => Err(Error::NoSuchCall),
            Some(Need::AnyOf(scopes)) if !scopes.iter().any(|&scope| caller.scopes.has(scope)) => {
                Err(Error::ScopeMissing {
                    needed: scopes.iter().map(|&scope| Scope::word(scope)).collect(),
                })
            }
            Some(_) => Ok(Some(caller)),
        }
    }

    async fn caller(&self, headers: &HeaderMap, address: Option<IpAddr>) -> Result<Caller> {
        // Who tries tokens out is slowed down too.
        let payer = Payer::at(address);
        let counted = |refusal| self.meter.count(Class::Call, &payer).err().unwrap_or(refusal);
        let shown = || token(headers).map(access::hash).map_err(counted);
        match &self.rule {
            Rule::Open => Ok(Caller::anybody(address)),
            Rule::OwnWorker(own) => match shown()? == *own {
                true => Ok(Caller::own_worker()),
                false => Err(counted(Error::TokenUnknown)),
            },
            Rule::Tokens {
                ledger,
                own_worker,
                memory,
            } => {
                let hash = shown()?;
                if *own_worker == Some(hash) {
                    return Ok(Caller::own_worker());
                }
                // Before the ledger has work with it, where it will most likely be refused.
                let doubted = memory.doubts(&payer, &hash);
                if doubted {
                    self.meter.count(Class::Call, &payer)?;
                }
                match known(ledger, &hash, address).await {
                    Ok(caller) => {
                        memory.found(&hash);
                        Ok(caller)
                    }
                    Err(refusal @ (Error::TokenUnknown | Error::TokenExpired | Error::TokenRevoked)) => {
                        memory.refuse(&payer, &hash);
                        Err(if doubted { refusal } else { counted(refusal) })
                    }
                    // A ledger that is away says nothing of the token.
                    Err(error) => Err(error),
                }
            }
        }
    }
}

/// Where a request comes from.
fn address(extensions: &Extensions) -> Option<IpAddr> {
    let info = extensions.get::<TcpConnectInfo>();
    info.and_then(TcpConnectInfo::remote_addr).map(|address| address.ip())
}

/// The token that came with a call.
fn token(headers: &HeaderMap) -> Result<&str> {
    let header = headers.get("authorization").ok_or(Error::TokenMissing)?;
    let text = header.to_str().map_err(|_| Error::TokenUnknown)?;
    let (scheme, token) = text.split_at_checked(SCHEME.len()).ok_or(Error::TokenUnknown)?;
    let token = token.trim();
    if !scheme.eq_ignore_ascii_case(SCHEME) || token.is_empty() || token.len() > MAX_TOKEN_BYTES {
        return Err(Error::TokenUnknown);
    }
    Ok(token)
}

/// Whose token has this hash, if it may still be used.
async fn known(ledger: &Arc<dyn TokenLedger>, hash: &[u8; 32], address: Option<IpAddr>) -> Result<Caller> {
    let row = ledger.find_token(hash).await?.ok_or(Error::TokenUnknown)?;
    let now = clock::now();
    if row.revoke_time.is_some() {
        return Err(Error::TokenRevoked);
    }
    if row.expire_time.is_some_and(|end| end <= now) {
        return Err(Error::TokenExpired);
    }
    note(ledger, &row, now);
    Ok(Caller {
        project: row.project,
        scopes: row.scopes,
        token: Some(row.id),
        address,
    })
}

/// Notes that a token is in use, without holding up the call.
fn note(ledger: &Arc<dyn TokenLedger>, row: &TokenRow, now: i64) {
    if row
        .last_use_time
        .is_some_and(|last| now < last.saturating_add(NOTE_EVERY))
    {
        return;
    }
    let (ledger, id) = (ledger.clone(), row.id);
    tokio::spawn(async move {
        if let Err(error) = ledger.touch_token(id, now).await {
            tracing::warn!(token = %id, error = %chain(&error), "the use of a token could not be noted");
        }
    });
}

impl<S> Layer<S> for Guard {
    type Service = Guarded<S>;

    fn layer(&self, inner: S) -> Guarded<S> {
        Guarded {
            inner,
            guard: self.clone(),
        }
    }
}

/// A service that nobody reaches but through the guard.
#[derive(Clone)]
pub struct Guarded<S> {
    inner: S,
    guard: Guard,
}

impl<S, B> Service<Request<B>> for Guarded<S>
where
    S: Service<Request<B>, Response = Response<Body>, Error = Infallible> + Clone + Send + 'static,
    S::Future: Send + 'static,
    B: Send + 'static,
{
    type Response = Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<'static, Result<Response<Body>, Infallible>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, mut request: Request<B>) -> Self::Future {
        // The one that is ready is the one to be called, and a clone takes its place.
        let other = self.inner.clone();
        let mut inner = std::mem::replace(&mut self.inner, other);
        let guard = self.guard.clone();
        Box::pin(async move {
            let address = address(request.extensions());
            match guard.admit(request.uri().path(), request.headers(), address).await {
                Ok(caller) => {
                    // What the services know of the caller is in the extensions, and nothing of the token goes further.
                    request.headers_mut().remove("authorization");
                    if let Some(caller) = caller {
                        request.extensions_mut().insert(caller);
                    }
                    inner.call(request).await
                }
                Err(error) => Ok(Status::from(error).into_http()),
            }
        })
    }
}

/// Who makes a call. There is always one where the guard has let it through.
pub(crate) fn caller<T>(request: &tonic::Request<T>) -> Result<Caller> {
    let caller = request.extensions().get::<Caller>().cloned();
    caller.ok_or_else(|| Error::internal("looking up who calls", "the guard was passed by"))
}

#[cfg(test)]
mod tests;
