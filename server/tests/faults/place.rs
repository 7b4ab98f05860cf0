//! Where a fault happens: a server of its own over one of the ledgers, always at the same address.
use std::net::TcpListener;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use crate::caller::Caller;
use crate::support::postgres::Cluster;
use crate::support::s3::{BUCKET, Endpoint};
use crate::support::{Bench, Server};

/// Whether the numbers are those of docs/reliability.md.
pub fn full() -> bool {
    std::env::var_os("GUARDSPLAT_FAULTS").is_some_and(|value| value == "full")
}

/// The number for the short version, or for the full one.
pub fn short_or_full<T>(short: T, in_full: T) -> T {
    if full() { in_full } else { short }
}

/// An address that is free now; whoever comes in between makes the test fail, and nothing worse.
pub fn free_address() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().to_string()
}

/// A folder and a ledger for one server after the other.
pub struct Place {
    pub bench: Bench,
    /// Where the ledger is, if it is in PostgreSQL.
    pub cluster: Option<&'static Cluster>,
    address: String,
}

impl Place {
    pub fn on_sqlite() -> Self {
        Self::new(None, None)
    }

    pub fn on_postgres() -> Option<Self> {
        Some(Self::on(Cluster::shared()?))
    }

    /// With a PostgreSQL that nobody else uses.
    pub fn on_postgres_alone() -> Option<Self> {
        // It ends with this process.
        Some(Self::on(Box::leak(Box::new(Cluster::start()?))))
    }

    fn on(cluster: &'static Cluster) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("ledger{}", COUNT.fetch_add(1, Ordering::Relaxed));
        cluster.create(&name, None);
        Self::new(Some(cluster), Some(&cluster.url(&name)))
    }

    fn new(cluster: Option<&'static Cluster>, url: Option<&str>) -> Self {
        let mut bench = Bench::new();
        for limit in ["SUBMISSIONS", "CLAIMS", "CALLS"] {
            bench.variable(&format!("GUARDSPLAT_MAX_{limit}_PER_MINUTE"), "0");
        }
        bench.variable("GUARDSPLAT_LOG_FILTER", "warn");
        if let Some(url) = url {
            bench.variable("GUARDSPLAT_DATABASE", url);
        }
        Self {
            bench,
            cluster,
            address: free_address(),
        }
    }

    /// Has servers keep artifacts in a bucket.
    pub fn keeps_artifacts_in(&mut self, endpoint: &Endpoint) {
        for (name, value) in endpoint.environment() {
            self.bench.variable(&name, &value);
        }
        let url = format!("s3://{BUCKET}/artifacts");
        self.bench.variable("GUARDSPLAT_ARTIFACTS", &url);
    }

    /// What the ledger is called in figures.
    pub fn ledger(&self) -> &'static str {
        if self.cluster.is_some() { "postgresql" } else { "sqlite" }
    }

    /// Starts a server, again after the one before is gone.
    pub async fn start(&self, flags: &[&str]) -> Server {
        let mut arguments = vec!["--listen", &self.address];
        arguments.extend(flags);
        self.bench.start_as(&arguments).await
    }

    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Calls on a connection of its own, made when it is needed and again when it is lost.
    pub fn caller(&self) -> Caller {
        Caller::new(&self.url())
    }

    /// Prints a figure for docs/reliability.md.
    pub fn figure(&self, text: &str) {
        println!("figure: {}: {text}", self.ledger());
    }
}

/// The 50th and the 99th of a hundred, and the worst, in milliseconds.
pub struct Quantiles {
    pub p50: f64,
    pub p99: f64,
    pub worst: f64,
}

impl Quantiles {
    pub fn of(mut times: Vec<Duration>) -> Self {
        times.sort();
        let ms = |i: usize| times[i.min(times.len() - 1)].as_secs_f64() * 1e3;
        Self {
            p50: ms(times.len() / 2),
            p99: ms(times.len() * 99 / 100),
            worst: ms(times.len() - 1),
        }
    }
}

impl std::fmt::Display for Quantiles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "p50 {:.1} ms, p99 {:.1} ms, worst {:.1} ms",
            self.p50, self.p99, self.worst
        )
    }
}
