//! Who is connected: so many at once, and so many of one address. When there are too many, a new connection takes the place
//! of the one that has been without a call for longest.
use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;
use tokio::time::Instant;

use crate::metrics::Metrics;
use crate::service::rate_limit::Payer;

/// Connections besides, for who calls from this machine: health checks, and the server's own worker.
const RESERVE: usize = 32;

/// How many connections there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConnectionLimits {
    /// At once.
    pub total: usize,
    /// Of one address.
    pub of_one_address: usize,
}

impl Default for ConnectionLimits {
    fn default() -> Self {
        Self {
            total: 4096,
            of_one_address: 1024,
        }
    }
}

/// The connections of one listener.
pub struct Connections {
    limits: ConnectionLimits,
    metrics: Arc<Metrics>,
    open: Mutex<Open>,
}

#[derive(Default)]
struct Open {
    next: u64,
    entries: HashMap<u64, Entry>,
    of_address: HashMap<Payer, usize>,
}

struct Entry {
    payer: Payer,
    activity: Arc<Activity>,
}

/// What a connection does.
pub struct Activity {
    state: Mutex<State>,
    give_way: Notify,
}

#[derive(Clone, Copy)]
struct State {
    calls: usize,
    /// Since when there are none.
    since: Instant,
}

/// Of one connection, for as long as it is there.
pub struct Place {
    connections: Arc<Connections>,
    id: u64,
    activity: Arc<Activity>,
}

/// Of one call, until its answer has ended.
pub struct UnderWay(Arc<Activity>);

impl Connections {
    /// None yet.
    pub fn new(limits: ConnectionLimits, metrics: Arc<Metrics>) -> Arc<Self> {
        Arc::new(Self {
            limits,
            metrics,
            open: Mutex::default(),
        })
    }

    /// A place for a connection from an address; none where all that it could take have calls.
    pub fn take(self: &Arc<Self>, address: IpAddr) -> Option<Place> {
        let payer = Payer::at(Some(address));
        let total = match address.is_loopback() {
            true => self.limits.total + RESERVE,
            false => self.limits.total,
        };
        let mut open = lock(&self.open);
        let of_address = open.of_address.get(&payer).copied().unwrap_or(0);
        let has_place = if of_address >= self.limits.of_one_address {
            self.make_room(&mut open, |entry| entry.payer == payer)
        } else if open.entries.len() >= total {
            self.make_room(&mut open, |_| true)
        } else {
            true
        };
        if !has_place {
            self.metrics.turned_away();
            return None;
        }
        let (id, activity) = (open.next, Arc::new(Activity::new()));
        open.next += 1;
        *open.of_address.entry(payer.clone()).or_default() += 1;
        let entry = Entry {
            payer,
            activity: activity.clone(),
        };
        open.entries.insert(id, entry);
        self.metrics.connected();
        Some(Place {
            connections: self.clone(),
            id,
            activity,
        })
    }

    /// Has the one give way that has been without a call for longest.
    fn make_room(&self, open: &mut Open, may_go: impl Fn(&Entry) -> bool) -> bool {
        let idle = open.entries.iter().filter(|(_, entry)| may_go(entry));
        let idle = idle.filter_map(|(&id, entry)| Some((entry.activity.idle_since()?, id)));
        let Some((_, id)) = idle.min() else {
            return false;
        };
        if let Some(entry) = open.remove(id) {
            entry.activity.give_way.notify_one();
            self.metrics.turned_away();
            self.metrics.disconnected();
        }
        true
    }
}

impl Open {
    fn remove(&mut self, id: u64) -> Option<Entry> {
        let entry = self.entries.remove(&id)?;
        match self.of_address.get_mut(&entry.payer) {
            Some(count) if *count > 1 => *count -= 1,
            _ => drop(self.of_address.remove(&entry.payer)),
        }
        Some(entry)
    }
}

impl Place {
    /// Returns when the connection has to make room for another.
    pub async fn lost(&self) {
        self.activity.give_way.notified().await;
    }

    /// What the connection does.
    pub fn activity(&self) -> &Arc<Activity> {
        &self.activity
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if lock(&self.connections.open).remove(self.id).is_some() {
            self.connections.metrics.disconnected();
        }
    }
}

impl Activity {
    fn new() -> Self {
        let state = State {
            calls: 0,
            since: Instant::now(),
        };
        Self {
            state: Mutex::new(state),
            give_way: Notify::new(),
        }
    }

    /// Counts a call.
    pub fn begin(self: &Arc<Self>) -> UnderWay {
        lock(&self.state).calls += 1;
        UnderWay(self.clone())
    }

    /// Since when there has been no call, if there is none.
    pub fn idle_since(&self) -> Option<Instant> {
        let state = *lock(&self.state);
        (state.calls == 0).then_some(state.since)
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        let mut state = lock(&self.0.state);
        state.calls -= 1;
        state.since = Instant::now();
    }
}

/// What these hold is whole at every moment.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use futures::FutureExt;

    use super::*;

    fn connections(total: usize, of_one_address: usize) -> Arc<Connections> {
        let limits = ConnectionLimits { total, of_one_address };
        Connections::new(limits, Arc::default())
    }

    fn at(text: &str) -> IpAddr {
        text.parse().unwrap()
    }

    fn is_lost(place: &Place) -> bool {
        place.lost().now_or_never().is_some()
    }

    #[test]
    fn the_longest_idle_one_gives_way() {
        let connections = connections(3, 3);
        let places: Vec<_> = ["192.0.2.1", "192.0.2.2", "192.0.2.3"]
            .map(|text| connections.take(at(text)).unwrap())
            .into();
        // The first has a call, the second had one.
        let call = places[0].activity().begin();
        drop(places[1].activity().begin());
        let fourth = connections.take(at("192.0.2.4")).unwrap();
        assert_eq!([0, 1, 2].map(|i| is_lost(&places[i])), [false, false, true]);
        let calls = [&places[1], &fourth].map(|place| place.activity().begin());
        assert!(connections.take(at("192.0.2.5")).is_none());
        // Who calls from this machine still comes in.
        let near: Vec<_> = (0..2).map(|_| connections.take(at("127.0.0.1")).unwrap()).collect();
        drop((call, calls, near, places, fourth));
        let open = lock(&connections.open);
        assert!(open.entries.is_empty() && open.of_address.is_empty());
    }

    #[test]
    fn an_address_makes_room_for_itself_only() {
        let connections = connections(100, 2);
        let other = connections.take(at("2001:db8:0:1::1")).unwrap();
        let first = connections.take(at("2001:db8::1")).unwrap();
        // The same network.
        let second = connections.take(at("2001:db8::2")).unwrap();
        let third = connections.take(at("2001:db8::3")).unwrap();
        assert_eq!([&other, &first, &second].map(is_lost), [false, true, false]);
        let calls = [&second, &third].map(|place| place.activity().begin());
        assert!(connections.take(at("2001:db8::4")).is_none());
        drop(calls);
        assert!(connections.take(at("2001:db8::4")).is_some());
    }
}
