//! What the ledger keeps of hooks and of what they are sent: a trait of its own beside [`super::Ledger`], which has it as
//! a supertrait.
//!
//! Deliveries are an outbox: when a job is over, the transaction that ends it makes a delivery for every hook that wants
//! to know, so that no event is lost between the two. A delivery is given out like a job, under a lease with a token.
use std::fmt;
use std::time::Duration;

use uuid::Uuid;

use super::types::{JobId, JobKind, JobRow, JobState};
use super::{LedgerError, Result};

/// Name of a hook.
pub type HookId = Uuid;
/// Name of a delivery, and of the event in it.
pub type DeliveryId = Uuid;

/// Which jobs a hook is told of. Without kinds, those of all; without states, of all that are final.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topics {
    /// What they do.
    pub kinds: Vec<JobKind>,
    /// What became of them.
    pub states: Vec<JobState>,
}

const KINDS: [JobKind; 3] = [JobKind::Embed, JobKind::Verify, JobKind::CreateKey];
const STATES: [JobState; 3] = [JobState::Succeeded, JobState::Failed, JobState::Cancelled];

/// How a kind counts in a set of them.
pub(super) fn kind_bit(kind: JobKind) -> i32 {
    1 << (kind as i32)
}

/// How a state counts in a set of them.
pub(super) fn state_bit(state: JobState) -> i32 {
    1 << (state as i32)
}

impl Topics {
    /// As the database has them.
    pub(super) fn bits(&self) -> (i32, i32) {
        let kinds = self.kinds.iter().fold(0, |bits, &kind| bits | kind_bit(kind));
        let states = self.states.iter().fold(0, |bits, &state| bits | state_bit(state));
        (kinds, states)
    }

    /// From what the database has.
    pub(super) fn from_bits(kinds: i64, states: i64) -> Result<Self> {
        let found = Self {
            kinds: KINDS
                .into_iter()
                .filter(|&k| kinds & i64::from(kind_bit(k)) != 0)
                .collect(),
            states: STATES
                .into_iter()
                .filter(|&s| states & i64::from(state_bit(s)) != 0)
                .collect(),
        };
        let (known_kinds, known_states) = found.bits();
        for (what, value, known) in [
            ("set of kinds", kinds, known_kinds),
            ("set of states", states, known_states),
        ] {
            if value != i64::from(known) {
                return Err(LedgerError::Corrupt { what, value });
            }
        }
        Ok(found)
    }
}

/// A hook to keep.
#[derive(Clone)]
pub struct NewHook {
    /// Its name.
    pub id: HookId,
    /// Whose it is.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// Where messages are sent to.
    pub url: String,
    /// Which jobs it is told of.
    pub topics: Topics,
    /// What messages are signed with, under the master key.
    pub sealed_secret: Vec<u8>,
}

/// What is known of a hook.
#[derive(Clone, PartialEq)]
pub struct HookRow {
    /// Its name.
    pub id: HookId,
    /// Whose it is.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// Where messages are sent to.
    pub url: String,
    /// Which jobs it is told of.
    pub topics: Topics,
    /// What messages are signed with, under the master key.
    pub sealed_secret: Vec<u8>,
    /// When it was made.
    pub create_time: i64,
}

impl fmt::Debug for HookRow {
    // A URL may hold what its owner would not have in logs.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HookRow").field("id", &self.id).finish_non_exhaustive()
    }
}

/// What became of a delivery. Numbers are kept in the database.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DeliveryState {
    /// Waits to be sent, or is being sent.
    Pending = 1,
    /// Acknowledged.
    Delivered = 2,
    /// Given up.
    Dead = 3,
}

impl DeliveryState {
    pub(super) fn of_number(value: i64) -> Result<Self> {
        match value {
            1 => Ok(Self::Pending),
            2 => Ok(Self::Delivered),
            3 => Ok(Self::Dead),
            _ => Err(LedgerError::Corrupt {
                what: "state of a delivery",
                value,
            }),
        }
    }
}

/// What is known of a delivery.
#[derive(Clone, Debug, PartialEq)]
pub struct DeliveryRow {
    /// Its name.
    pub id: DeliveryId,
    /// Where it goes.
    pub hook: HookId,
    /// Whose it is.
    pub project: String,
    /// What it tells of.
    pub job: JobId,
    /// What became of that job.
    pub job_state: JobState,
    /// What became of the delivery.
    pub state: DeliveryState,
    /// How often it was sent since `since`.
    pub attempts: i32,
    /// Why the last attempt failed; empty where none did.
    pub last_error: String,
    /// When its job was over.
    pub create_time: i64,
    /// When trying began, for the last time.
    pub since: i64,
    /// Not sent before; while it is being sent, the end of the lease.
    pub next_time: i64,
    /// When it was last sent.
    pub last_time: Option<i64>,
    /// When it was acknowledged or given up.
    pub end_time: Option<i64>,
}

/// Which deliveries a list is of.
#[derive(Clone, Copy, Debug, Default)]
pub struct DeliveryFilter {
    /// Those to this hook, which must be the project's.
    pub hook: Option<HookId>,
    /// Those in this state.
    pub state: Option<DeliveryState>,
}

/// Most deliveries of a project that wait. Those of jobs that end while there are as many are dead at once.
pub const MOST_WAITING: i64 = 10_000;

/// Who has as many messages under way as they may.
#[derive(Clone, Debug, Default)]
pub struct Busy {
    /// These hooks.
    pub hooks: Vec<HookId>,
    /// All hooks of these projects.
    pub projects: Vec<String>,
}

/// The right to one attempt to send a delivery, and what is needed for it.
#[derive(Clone)]
pub struct Sending {
    /// The delivery, with this attempt counted.
    pub delivery: DeliveryRow,
    /// Where it goes.
    pub hook: HookRow,
    /// What it tells of, if it is still there.
    pub job: Option<JobRow>,
    /// What the caller called the request for that job.
    pub asked_id: Option<Uuid>,
    /// What is sent, if there was an attempt before.
    pub body: Option<Vec<u8>>,
    /// The secret that goes with what came of the attempt. Only its hash is kept.
    pub token: String,
}

impl fmt::Debug for Sending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sending")
            .field("delivery", &self.delivery)
            .finish_non_exhaustive()
    }
}

/// What the service keeps of hooks.
#[async_trait::async_trait]
pub trait HookLedger: Send + Sync + 'static {
    /// Keeps a hook. It is told of jobs that are over from then on.
    async fn create_hook(&self, new: NewHook, now: i64) -> Result<HookRow>;

    /// One hook.
    async fn get_hook(&self, id: HookId) -> Result<Option<HookRow>>;

    /// Hooks of a project, newest first; those after `before` (the `create_time` and id of the last of the page before).
    async fn list_hooks(&self, project: &str, before: Option<(i64, HookId)>, limit: u32) -> Result<Vec<HookRow>>;

    /// Removes a hook and its deliveries.
    ///
    /// # Errors
    /// `NotFound`.
    async fn delete_hook(&self, id: HookId) -> Result<()>;

    /// One delivery.
    async fn get_delivery(&self, id: DeliveryId) -> Result<Option<DeliveryRow>>;

    /// Deliveries of a project, newest first; those after `before`, as with `list_hooks`.
    async fn list_deliveries(
        &self,
        project: &str,
        filter: DeliveryFilter,
        before: Option<(i64, DeliveryId)>,
        limit: u32,
    ) -> Result<Vec<DeliveryRow>>;

    /// Has a delivery sent again, with attempts counted anew. One that is being sent stays as it is.
    ///
    /// # Errors
    /// `NotFound`.
    async fn redeliver(&self, id: DeliveryId, now: i64) -> Result<DeliveryRow>;

    /// Gives out the delivery that has been due for longest, but none of whoever is `busy`, and counts the attempt.
    /// Nobody else is given it before `now + lease`.
    async fn claim_delivery(&self, busy: &Busy, lease: Duration, now: i64) -> Result<Option<Sending>>;

    /// Keeps what is sent, from the first attempt on. `false` where the lease is lost, and nothing changed.
    async fn keep_delivery_body(&self, id: DeliveryId, token: &str, body: &[u8]) -> Result<bool>;

    /// A delivery was acknowledged. `false` where the lease is lost, and nothing changed.
    async fn delivered(&self, id: DeliveryId, token: &str, now: i64) -> Result<bool>;

    /// An attempt failed; the next is at `next`, or the delivery is dead. `false` where the lease is lost, and nothing
    /// changed.
    async fn not_delivered(
        &self,
        id: DeliveryId,
        token: &str,
        error: &str,
        next: Option<i64>,
        now: i64,
    ) -> Result<bool>;

    /// Removes deliveries that were over before `older_than`, `limit` at most, and says how many.
    async fn forget_deliveries(&self, older_than: i64, limit: u32) -> Result<u64>;
}
