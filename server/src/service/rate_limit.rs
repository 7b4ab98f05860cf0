//! How often a caller may call: so many a minute of each class, by project where tokens are asked for, by address where
//! not. All of a minute's may come at once.
use std::hash::{BuildHasher, RandomState};
use std::net::{IpAddr, Ipv6Addr};
use std::num::NonZeroU32;
use std::time::Duration;

use governor::clock::{Clock, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};

use crate::access::Caller;
use crate::error::{Error, Result};

/// Callers are told apart by so many bits of a hash. That bounds the memory, whoever calls from wherever; that two share
/// a place is rare, and as the hash is keyed nobody can arrange it.
const BITS: u32 = 14;

/// Most calls of a class that a caller may make in a minute; 0 is no limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rates {
    /// What is kept for long: jobs, uploads, owners, assets, tokens.
    pub submissions: u32,
    /// Jobs that verify, besides.
    pub claims: u32,
    /// Everything else but health and what workers say, and calls that are refused for their token.
    pub calls: u32,
}

impl Default for Rates {
    fn default() -> Self {
        Self {
            submissions: 6_000,
            claims: 6_000,
            calls: 60_000,
        }
    }
}

/// What is counted together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// See [`Rates::submissions`].
    Submission,
    /// See [`Rates::claims`].
    Claim,
    /// See [`Rates::calls`].
    Call,
}

impl Class {
    /// The class of a call; none for those that are not counted.
    pub fn of(path: &str) -> Option<Self> {
        let (service, method) = path.strip_prefix('/')?.split_once('/')?;
        match (service, method) {
            // Workers are the operator's, and their calls follow from jobs that were counted.
            ("guardsplat.v1.WorkerService", _) => None,
            (service, _) if service.starts_with("grpc.health.") => None,
            (
                _,
                "CreateJob" | "UploadArtifact" | "StartUpload" | "FinishUpload" | "CreateOwner" | "CreateAsset"
                | "CreateToken" | "CreateHook" | "RedeliverDelivery",
            ) => Some(Self::Submission),
            _ => Some(Self::Call),
        }
    }

    fn words(self) -> &'static str {
        match self {
            Self::Submission => "submissions",
            Self::Claim => "claims",
            Self::Call => "calls",
        }
    }
}

/// Whose calls are counted together.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Payer {
    /// Everybody who calls for a project.
    Project(String),
    /// Everybody at an address.
    Address(IpAddr),
}

impl Payer {
    /// Whoever is at an address. Those who have one of version 6 have 2^64 of them.
    pub fn at(address: Option<IpAddr>) -> Self {
        Self::Address(match address {
            Some(IpAddr::V6(ip)) => {
                let network = u128::from(ip) >> 64 << 64;
                Ipv6Addr::from(network).into()
            }
            Some(ip) => ip,
            None => Ipv6Addr::UNSPECIFIED.into(),
        })
    }
}

/// Counts calls.
pub struct Meter {
    submissions: Option<Table>,
    claims: Option<Table>,
    calls: Option<Table>,
    places: RandomState,
}

struct Table {
    limiter: DefaultKeyedRateLimiter<u16>,
    per_minute: u32,
}

impl Meter {
    /// One that holds callers to these.
    pub fn new(rates: Rates) -> Self {
        let table = |per_minute| {
            NonZeroU32::new(per_minute).map(|most| Table {
                limiter: RateLimiter::hashmap(Quota::per_minute(most)),
                per_minute,
            })
        };
        Self {
            submissions: table(rates.submissions),
            claims: table(rates.claims),
            calls: table(rates.calls),
            places: RandomState::new(),
        }
    }

    /// Counts a call, or refuses it.
    pub fn count(&self, class: Class, payer: &Payer) -> Result<()> {
        let table = match class {
            Class::Submission => &self.submissions,
            Class::Claim => &self.claims,
            Class::Call => &self.calls,
        };
        let Some(Table { limiter, per_minute }) = table else {
            return Ok(());
        };
        let place = (self.places.hash_one(payer) >> (64 - BITS)) as u16; // it has no more bits than that
        limiter.check_key(&place).map_err(|refusal| Error::TooManyCalls {
            what: class.words(),
            per_minute: *per_minute,
            retry_after: refusal
                .wait_time_from(DefaultClock::default().now())
                .max(Duration::from_millis(1)),
        })
    }
}

/// Whose calls are counted together with this caller's.
pub(crate) fn payer(caller: &Caller) -> Payer {
    match caller.token {
        Some(_) => Payer::Project(caller.project.clone()),
        None => Payer::at(caller.address),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meter(calls: u32) -> Meter {
        Meter::new(Rates {
            submissions: 0,
            calls,
            ..Rates::default()
        })
    }

    #[test]
    fn a_caller_has_so_many_a_minute_and_others_have_theirs() {
        let meter = meter(3);
        let (one, other) = (Payer::Project("one".into()), Payer::Project("other".into()));
        for _ in 0..3 {
            meter.count(Class::Call, &one).unwrap();
        }
        let Err(Error::TooManyCalls {
            what,
            per_minute,
            retry_after,
        }) = meter.count(Class::Call, &one)
        else {
            panic!("was let through")
        };
        assert_eq!((what, per_minute), ("calls", 3));
        // A third of a minute makes room for one more.
        assert!((1..=20).contains(&retry_after.as_secs()), "{retry_after:?}");
        meter.count(Class::Call, &other).unwrap();
        for _ in 0..100 {
            meter.count(Class::Submission, &one).unwrap();
        }
    }

    #[test]
    fn memory_is_bounded_whoever_calls() {
        let meter = meter(1);
        for i in 0..100_000_u32 {
            let _ = meter.count(Class::Call, &Payer::at(Some(IpAddr::V4(i.into()))));
        }
        assert!(meter.calls.as_ref().unwrap().limiter.len() <= 1 << BITS);
    }

    #[test]
    fn an_address_of_version_6_is_a_network() {
        let at = |text: &str| Payer::at(Some(text.parse().unwrap()));
        assert_eq!(at("2001:db8::1"), at("2001:db8::ffff:1"));
        assert_ne!(at("2001:db8::1"), at("2001:db8:0:1::1"));
        assert_ne!(at("192.0.2.1"), at("192.0.2.2"));
    }

    #[test]
    fn classes_are_by_path() {
        let of = |path: &str| Class::of(path);
        assert_eq!(of("/guardsplat.v1.JobService/CreateJob"), Some(Class::Submission));
        assert_eq!(of("/guardsplat.v1.JobService/GetJob"), Some(Class::Call));
        assert_eq!(of("/guardsplat.v1.WorkerService/ReportJob"), None);
        assert_eq!(of("/grpc.health.v1.Health/Check"), None);
        assert_eq!(of("/no.such.Service/Call"), Some(Class::Call));
    }
}
