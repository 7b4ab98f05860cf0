//! `HookService`: hooks of the caller's project, and what became of what they were sent.
use guardsplat_proto::v1;
use guardsplat_proto::v1::delivery::State;
use guardsplat_proto::v1::hook::Kind as WireKind;
use guardsplat_proto::v1::hook_service_server::HookService;
use guardsplat_proto::v1::{
    CreateHookRequest, CreateHookResponse, DeleteHookRequest, Delivery, GetHookRequest, Hook, ListDeliveriesRequest,
    ListDeliveriesResponse, ListHooksRequest, ListHooksResponse, RedeliverDeliveryRequest,
};
use secrecy::ExposeSecret;
use tonic::{Request, Response, Status};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::grpc::guard::caller;
use crate::hooks::{self, Rules, check_url, event, signature};
use crate::ledger::{DeliveryFilter, DeliveryRow, DeliveryState, HookRow, JobKind, JobState, NewHook, Topics};
use crate::secrets::{self, SecretError};
use crate::service::clock::{self, timestamp};
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{Service, page, text};

/// Most hooks of a project: each job's end is told to all of them.
const MAX_HOOKS: u32 = 100;

#[tonic::async_trait]
impl HookService for Service {
    async fn create_hook(&self, request: Request<CreateHookRequest>) -> Result<Response<CreateHookResponse>, Status> {
        let caller = caller(&request)?;
        let asked = checked(&self.limits().hooks, request.into_inner())?;
        self.room_for_hook(&caller.project).await?;
        let id = Uuid::now_v7();
        let failed = |error: SecretError| Error::internal("making a secret", error);
        let secret = secrets::random::<{ signature::SECRET_BYTES }>().map_err(failed)?;
        let sealed_secret = self.master().seal(&hooks::secret_context(id), secret.expose_secret());
        let new = NewHook {
            id,
            project: caller.project,
            display_name: asked.display_name,
            url: asked.url,
            topics: asked.topics,
            sealed_secret: sealed_secret.map_err(failed)?,
        };
        let row = self.ledger().create_hook(new, clock::now()).await;
        let row = row.map_err(Error::from)?;
        tracing::info!(hook = %row.id, project = row.project, by = ?caller.token, "hook made");
        Ok(Response::new(CreateHookResponse {
            hook: Some(hook(row)),
            secret: signature::text(secret.expose_secret()).expose_secret().to_owned(),
        }))
    }

    async fn get_hook(&self, request: Request<GetHookRequest>) -> Result<Response<Hook>, Status> {
        let project = caller(&request)?.project;
        let row = self.owned_hook(&project, "name", &request.get_ref().name).await?;
        Ok(Response::new(hook(row)))
    }

    async fn list_hooks(&self, request: Request<ListHooksRequest>) -> Result<Response<ListHooksResponse>, Status> {
        let project = caller(&request)?.project;
        let ListHooksRequest { page_size, page_token } = request.into_inner();
        let size = page::size(page_size)?;
        let query: [&[u8]; 2] = [b"hooks", project.as_bytes()];
        let before = page::position(&query, &page_token)?;
        // One more than asked for tells whether there is another page.
        let rows = self.ledger().list_hooks(&project, before, size + 1).await;
        let rows = rows.map_err(Error::from)?;
        let (rows, next_page_token) = page::cut(&query, rows, size, |row| (row.create_time, row.id));
        Ok(Response::new(ListHooksResponse {
            hooks: rows.into_iter().map(hook).collect(),
            next_page_token,
        }))
    }

    async fn delete_hook(&self, request: Request<DeleteHookRequest>) -> Result<Response<()>, Status> {
        let caller = caller(&request)?;
        let row = self
            .owned_hook(&caller.project, "name", &request.get_ref().name)
            .await?;
        self.ledger().delete_hook(row.id).await.map_err(Error::from)?;
        tracing::info!(hook = %row.id, project = row.project, by = ?caller.token, "hook deleted");
        Ok(Response::new(()))
    }

    async fn list_deliveries(
        &self,
        request: Request<ListDeliveriesRequest>,
    ) -> Result<Response<ListDeliveriesResponse>, Status> {
        let project = caller(&request)?.project;
        let request = request.into_inner();
        let size = page::size(request.page_size)?;
        let filter = DeliveryFilter {
            hook: match request.hook.as_str() {
                "" => None,
                name => Some(self.owned_hook(&project, "hook", name).await?.id),
            },
            state: state_of(request.state)?,
        };
        let state = [filter.state.map_or(0, |state| state as u8)];
        let query: [&[u8]; 4] = [b"deliveries", project.as_bytes(), request.hook.as_bytes(), &state];
        let before = page::position(&query, &request.page_token)?;
        let rows = self.ledger().list_deliveries(&project, filter, before, size + 1).await;
        let rows = rows.map_err(Error::from)?;
        let (rows, next_page_token) = page::cut(&query, rows, size, |row| (row.create_time, row.id));
        Ok(Response::new(ListDeliveriesResponse {
            deliveries: rows.into_iter().map(delivery).collect(),
            next_page_token,
        }))
    }

    async fn redeliver_delivery(
        &self,
        request: Request<RedeliverDeliveryRequest>,
    ) -> Result<Response<Delivery>, Status> {
        let project = caller(&request)?.project;
        let id = ResourceKind::Delivery.parse("name", &request.get_ref().name)?;
        let row = self.ledger().get_delivery(id).await.map_err(Error::from)?;
        let own = row.filter(|row| row.project == project);
        own.ok_or_else(|| ResourceKind::Delivery.not_found(id))?;
        let row = self.ledger().redeliver(id, clock::now()).await.map_err(Error::from)?;
        Ok(Response::new(delivery(row)))
    }
}

impl Service {
    async fn owned_hook(&self, project: &str, field: &str, name: &str) -> Result<HookRow> {
        let id = ResourceKind::Hook.parse(field, name)?;
        let row = self.ledger().get_hook(id).await?;
        let own = row.filter(|row| row.project == project);
        own.ok_or_else(|| ResourceKind::Hook.not_found(id))
    }

    /// Refuses a hook of a project that has as many as it may. What arrives at the same moment may go over by itself.
    async fn room_for_hook(&self, project: &str) -> Result<()> {
        let there = self.ledger().list_hooks(project, None, MAX_HOOKS).await?;
        if there.len() < MAX_HOOKS as usize {
            return Ok(());
        }
        Err(Error::QuotaUsedUp {
            what: "hooks",
            project: project.to_owned(),
            limit: MAX_HOOKS.into(),
        })
    }
}

/// A hook that may be made.
struct Asked {
    display_name: String,
    url: String,
    topics: Topics,
}

fn checked(rules: &Rules, request: CreateHookRequest) -> Result<Asked> {
    let hook = request.hook.ok_or_else(|| Error::invalid("hook", "is missing"))?;
    let mut problems = Violations::default();
    problems.take(text::display_name("hook.display_name", &hook.display_name))?;
    let url = check_url(rules, &hook.url).map_err(|reason| Error::invalid("hook.url", reason));
    let url = problems.take(url)?;
    let kinds = problems.take(kinds(&hook.kinds))?.unwrap_or_default();
    let states = problems.take(states(&hook.states))?.unwrap_or_default();
    for (field, empty) in [
        ("hook.name", hook.name.is_empty()),
        ("hook.project", hook.project.is_empty()),
        ("hook.create_time", hook.create_time.is_none()),
    ] {
        problems.check(empty, field, "is set by the server and must be empty");
    }
    problems.finish()?;
    Ok(Asked {
        display_name: hook.display_name,
        url: url.map(String::from).unwrap_or_default(), // what is missing was a problem above
        topics: Topics { kinds, states },
    })
}

fn kinds(given: &[i32]) -> Result<Vec<JobKind>> {
    let one = |(i, number): (usize, &i32)| match WireKind::try_from(*number) {
        Ok(WireKind::Embed) => Ok(JobKind::Embed),
        Ok(WireKind::Verify) => Ok(JobKind::Verify),
        Ok(WireKind::CreateKey) => Ok(JobKind::CreateKey),
        Ok(WireKind::Unspecified) | Err(_) => Err(Error::invalid(
            format!("hook.kinds[{i}]"),
            format!("{number} is no kind of job"),
        )),
    };
    given.iter().enumerate().map(one).collect()
}

fn states(given: &[i32]) -> Result<Vec<JobState>> {
    use v1::job::State;
    let one = |(i, number): (usize, &i32)| match State::try_from(*number) {
        Ok(State::Succeeded) => Ok(JobState::Succeeded),
        Ok(State::Failed) => Ok(JobState::Failed),
        Ok(State::Cancelled) => Ok(JobState::Cancelled),
        Ok(_) | Err(_) => Err(Error::invalid(
            format!("hook.states[{i}]"),
            "must be succeeded, failed or cancelled",
        )),
    };
    given.iter().enumerate().map(one).collect()
}

fn state_of(number: i32) -> Result<Option<DeliveryState>> {
    match State::try_from(number) {
        Ok(State::Unspecified) => Ok(None),
        Ok(State::Pending) => Ok(Some(DeliveryState::Pending)),
        Ok(State::Delivered) => Ok(Some(DeliveryState::Delivered)),
        Ok(State::Dead) => Ok(Some(DeliveryState::Dead)),
        Err(_) => Err(Error::invalid("state", format!("{number} is no state of a delivery"))),
    }
}

fn hook(row: HookRow) -> Hook {
    let kind = |kind: &JobKind| match kind {
        JobKind::Embed => WireKind::Embed,
        JobKind::Verify => WireKind::Verify,
        JobKind::CreateKey => WireKind::CreateKey,
    };
    Hook {
        name: ResourceKind::Hook.name(row.id),
        display_name: row.display_name,
        project: row.project,
        url: row.url,
        kinds: row.topics.kinds.iter().map(|each| kind(each).into()).collect(),
        // Numbers of states are those of the API.
        states: row.topics.states.iter().map(|&state| state as i32).collect(),
        create_time: Some(timestamp(row.create_time)),
    }
}

fn delivery(row: DeliveryRow) -> Delivery {
    let pending = row.state == DeliveryState::Pending;
    let state = match row.state {
        DeliveryState::Pending => State::Pending,
        DeliveryState::Delivered => State::Delivered,
        DeliveryState::Dead => State::Dead,
    };
    Delivery {
        name: ResourceKind::Delivery.name(row.id),
        hook: ResourceKind::Hook.name(row.hook),
        job: ResourceKind::Job.name(row.job),
        r#type: event::event_type(row.job_state),
        state: state.into(),
        attempts: row.attempts,
        last_error: row.last_error,
        create_time: Some(timestamp(row.create_time)),
        last_attempt_time: row.last_time.map(timestamp),
        next_attempt_time: pending.then(|| timestamp(row.next_time)),
        end_time: row.end_time.map(timestamp),
    }
}
