//! `hook create`, `list`, `delete`, `deliveries` and `redeliver`.
use guardsplat_proto::v1::hook_service_server::HookService;
use guardsplat_proto::v1::{
    CreateHookRequest, CreateHookResponse, DeleteHookRequest, Delivery, GetHookRequest, Hook, ListDeliveriesRequest,
    ListDeliveriesResponse, ListHooksRequest, ListHooksResponse, RedeliverDeliveryRequest, delivery, hook, job,
};
use tonic::{Request, Response, Status};

use super::fake::Fake;
use super::run::TestEnvironment;
use super::services::not_found;

const NAME: &str = "hooks/0190a5d0-0000-7000-8000-00000000000c";
const DELIVERY: &str = "deliveries/0190a5d0-0000-7000-8000-00000000000d";
const SECRET: &str = "whsec_NWVjMmU3NWVjMmU3NWVjMmU3NWVjMmU3NWVjMmU3NWU=";

#[tonic::async_trait]
impl HookService for Fake {
    async fn create_hook(&self, request: Request<CreateHookRequest>) -> Result<Response<CreateHookResponse>, Status> {
        let mut hook = request.into_inner().hook.unwrap();
        hook.name = NAME.into();
        hook.project = "studio".into();
        self.state().hooks.push(hook.clone());
        Ok(Response::new(CreateHookResponse {
            hook: Some(hook),
            secret: SECRET.into(),
        }))
    }

    async fn get_hook(&self, _: Request<GetHookRequest>) -> Result<Response<Hook>, Status> {
        Err(Status::unimplemented(""))
    }

    async fn list_hooks(&self, _: Request<ListHooksRequest>) -> Result<Response<ListHooksResponse>, Status> {
        Ok(Response::new(ListHooksResponse {
            hooks: self.state().hooks.clone(),
            next_page_token: String::new(),
        }))
    }

    async fn delete_hook(&self, request: Request<DeleteHookRequest>) -> Result<Response<()>, Status> {
        let name = request.into_inner().name;
        let mut state = self.state();
        let before = state.hooks.len();
        state.hooks.retain(|hook| hook.name != name);
        if state.hooks.len() == before {
            return Err(not_found(&name));
        }
        Ok(Response::new(()))
    }

    /// One a page, so that several are asked for.
    async fn list_deliveries(
        &self,
        request: Request<ListDeliveriesRequest>,
    ) -> Result<Response<ListDeliveriesResponse>, Status> {
        let request = request.into_inner();
        let mut found = self.state().deliveries.clone();
        found.retain(|one| request.hook.is_empty() || one.hook == request.hook);
        found.retain(|one| request.state == 0 || one.state == request.state);
        let at: usize = request.page_token.parse().unwrap_or_default();
        let more = at + 1 < found.len();
        Ok(Response::new(ListDeliveriesResponse {
            deliveries: found.into_iter().skip(at).take(1).collect(),
            next_page_token: if more { (at + 1).to_string() } else { String::new() },
        }))
    }

    async fn redeliver_delivery(
        &self,
        request: Request<RedeliverDeliveryRequest>,
    ) -> Result<Response<Delivery>, Status> {
        let name = request.into_inner().name;
        let mut state = self.state();
        let found = state.deliveries.iter_mut().find(|one| one.name == name);
        let found = found.ok_or_else(|| not_found(&name))?;
        found.set_state(delivery::State::Pending);
        Ok(Response::new(found.clone()))
    }
}

#[test]
fn a_hook_is_made_shown_once_and_deleted() {
    let environment = TestEnvironment::new();
    let ran = environment.run("hook create https://shop.example/hook --kind embed --state succeeded --state failed");
    assert_eq!(ran.code, 0, "{}", ran.err);
    // Alone on standard output, so that it can go straight into a file.
    assert_eq!(ran.out, format!("{SECRET}\n"));
    assert!(
        ran.err.contains("succeeded, failed ends") && !ran.err.contains("whsec"),
        "{}",
        ran.err
    );
    let made = environment.fake.state().hooks[0].clone();
    assert_eq!(made.kinds().collect::<Vec<_>>(), [hook::Kind::Embed]);
    assert_eq!(
        made.states().collect::<Vec<_>>(),
        [job::State::Succeeded, job::State::Failed]
    );
    let listed = environment.run("hook list --json").json();
    assert_eq!(listed["hooks"][0]["url"], "https://shop.example/hook");
    assert_eq!(environment.run(&format!("hook delete {}", &NAME[6..])).code, 0);
    assert_eq!(environment.run(&format!("hook delete {NAME}")).code, 1);
    assert_eq!(environment.run("hook list").out, "");
    assert_eq!(environment.run("hook delete 7").code, 1);
}

#[test]
fn deliveries_are_listed_and_sent_again() {
    let environment = TestEnvironment::new();
    let mut dead = Delivery {
        name: DELIVERY.into(),
        hook: NAME.into(),
        job: "jobs/0190a5d0-0000-7000-8000-00000000000e".into(),
        r#type: "guardsplat.job.failed.v1".into(),
        attempts: 9,
        last_error: "answered 500".into(),
        ..Delivery::default()
    };
    dead.set_state(delivery::State::Dead);
    let done = Delivery {
        name: DELIVERY.replace("0d", "0f"),
        state: delivery::State::Delivered.into(),
        last_error: String::new(),
        ..dead.clone()
    };
    environment.fake.state().deliveries = vec![dead, done];
    let all = environment.run("hook deliveries");
    assert_eq!(all.out.lines().count(), 2, "{}", all.err);
    assert!(all.out.contains("dead  guardsplat.job.failed.v1") && all.out.contains("9 attempts  answered 500"));
    assert_eq!(environment.run("hook deliveries --limit 1").out.lines().count(), 1);
    let dead = environment
        .run(&format!("hook deliveries --state dead --hook {NAME} --json"))
        .json();
    assert_eq!(dead["deliveries"].as_array().unwrap().len(), 1);
    assert_eq!(dead["deliveries"][0]["name"], DELIVERY);
    let again = environment.run(&format!("hook redeliver {DELIVERY} --json")).json();
    assert_eq!(again["state"], "pending");
}
