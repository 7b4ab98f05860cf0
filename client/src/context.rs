//! What every command works with, and how it calls the server.
use std::cell::RefCell;
use std::time::{Duration, Instant};

use guardsplat_proto::connect::Channel;
use tokio::time::timeout;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::{Request, Response, Status};

use crate::backoff::Backoff;
use crate::console::Console;
use crate::details::retry_delay;
use crate::error::{Error, Result, why_lost};
use crate::options::Global;
use crate::server::{Server, is_lost};
use crate::settings::Settings;
use crate::stage::Stage;
use crate::trace::{self, Trace};

/// What the commands share.
pub struct Context {
    /// The server.
    pub server: Server,
    /// Standard error.
    pub console: Console,
    /// Whether results go out as JSON.
    pub json: bool,
    /// What its calls are a part of, where somebody traces.
    trace: Option<MetadataValue<Ascii>>,
    /// How far the command is, for when it is interrupted.
    pub stage: RefCell<Stage>,
}

impl Context {
    /// Reads the settings; nothing is sent.
    pub fn new(global: &Global) -> Result<Self> {
        Ok(Self {
            server: Server::new(&Settings::load(global)?)?,
            console: Console::new(),
            json: global.json,
            trace: None,
            stage: RefCell::new(Stage::Nothing),
        })
    }

    /// From here on, calls say that they are a part of this.
    pub fn trace(&mut self, trace: &Trace) {
        self.trace = trace.header.clone();
    }

    /// From here on, an interrupt leaves things so.
    pub fn enter(&self, stage: Stage) {
        self.stage.replace(stage);
    }

    /// Waits before a lost server are taken from here.
    pub fn backoff(&self) -> Backoff {
        Backoff::new(self.server.timeout)
    }

    /// Calls the server once.
    pub async fn once<M, R>(
        &self,
        doing: &'static str,
        message: M,
        send: impl AsyncFnOnce(Channel, Request<M>) -> Result<Response<R>, Status>,
    ) -> Result<R> {
        let channel = self.server.channel().await?;
        // Timed here: the transport's own limit looks like a lost connection, which would be waited for once more.
        match self.in_time(send(channel, self.request(message))).await {
            Ok(response) => Ok(response.into_inner()),
            Err(status) => Err(refused(doing, status)),
        }
    }

    /// A call that says what it is a part of.
    pub fn request<M>(&self, message: M) -> Request<M> {
        let mut request = Request::new(message);
        if let Some(parent) = &self.trace {
            request.metadata_mut().insert(trace::HEADER, parent.clone());
        }
        request
    }

    /// Calls the server, again if it is lost meanwhile: only for what may arrive twice.
    pub async fn call<M: Clone, R>(
        &self,
        doing: &'static str,
        message: M,
        send: impl AsyncFn(Channel, Request<M>) -> Result<Response<R>, Status>,
    ) -> Result<R> {
        let mut backoff = self.backoff();
        loop {
            match self.once(doing, message.clone(), &send).await {
                Err(Error::Refused { status, .. }) if is_lost(&status) => {
                    self.pause(&mut backoff, doing, &status, "").await?;
                }
                other => return other,
            }
        }
    }

    /// The server was lost: says so and waits a while, or gives up with `hint`.
    pub async fn pause(&self, backoff: &mut Backoff, doing: &'static str, status: &Status, hint: &str) -> Result<()> {
        let first = !backoff.is_lost();
        let Some(wait) = backoff.lost(Instant::now(), retry_delay(status)) else {
            return Err(Error::Lost {
                url: self.server.url.clone(),
                doing,
                seconds: self.server.timeout.as_secs(),
                reason: why_lost(status),
                hint: hint.to_owned(),
            });
        };
        if first {
            self.console.say(&format!(
                "the server was lost while {doing} ({}); trying again",
                why_lost(status)
            ));
        }
        tokio::time::sleep(wait).await;
        Ok(())
    }

    /// What comes of `future`, or a status that says that the server was silent for too long.
    pub async fn in_time<T>(&self, future: impl Future<Output = Result<T, Status>>) -> Result<T, Status> {
        let limit = self.server.timeout;
        timeout(limit, future).await.unwrap_or_else(|_| Err(silent(limit)))
    }
}

/// The status for a server that is there but says nothing.
pub fn silent(limit: Duration) -> Status {
    Status::deadline_exceeded(format!("the server was silent for {} s", limit.as_secs()))
}

/// The error for a status.
pub fn refused(doing: &'static str, status: Status) -> Error {
    Error::Refused {
        doing,
        status: Box::new(status),
    }
}
