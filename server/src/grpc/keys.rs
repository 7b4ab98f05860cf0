//! `KeyService`: what is known of keys, and what they may be used for. Their secrets are not here.
use guardsplat_proto::v1::key::State;
use guardsplat_proto::v1::key_service_server::KeyService;
use guardsplat_proto::v1::{GetKeyRequest, Key, ListKeysRequest, ListKeysResponse, UpdateKeyStateRequest};
use tonic::{Request, Response, Status};

use crate::error::{Error, Result};
use crate::grpc::guard::caller;
use crate::ledger::{KeyId, KeyState};
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{Service, clock, page, text, to_proto};

/// What page tokens of this list are bound to.
const QUERY: &[&[u8]] = &[b"keys"];

#[tonic::async_trait]
impl KeyService for Service {
    async fn get_key(&self, request: Request<GetKeyRequest>) -> Result<Response<Key>, Status> {
        let id = ResourceKind::Key.parse("name", &request.get_ref().name)?;
        let row = self.owned_key(&caller(&request)?.project, id).await?;
        Ok(Response::new(to_proto::key(row)))
    }

    async fn list_keys(&self, request: Request<ListKeysRequest>) -> Result<Response<ListKeysResponse>, Status> {
        let project = caller(&request)?.project;
        let ListKeysRequest { page_size, page_token } = request.into_inner();
        let size = page::size(page_size)?;
        let before = page::position(QUERY, &page_token)?;
        // One more than asked for tells whether there is another page.
        let rows = self.ledger().list_keys(&project, before, size + 1).await;
        let rows = rows.map_err(Error::from)?;
        let (rows, next_page_token) = page::cut(QUERY, rows, size, |row| (row.create_time, row.id));
        Ok(Response::new(ListKeysResponse {
            keys: rows.into_iter().map(to_proto::key).collect(),
            next_page_token,
        }))
    }

    async fn update_key_state(&self, request: Request<UpdateKeyStateRequest>) -> Result<Response<Key>, Status> {
        let project = caller(&request)?.project;
        let (id, next, reason) = checked(request.into_inner())?;
        self.owned_key(&project, id).await?;
        let updated = self.ledger().update_key_state(id, next, &reason, clock::now()).await;
        let row = updated.map_err(Error::from)?;
        tracing::info!(key = %id, state = row.state.word(), reason = row.state_reason, "state of a key");
        Ok(Response::new(to_proto::key(row)))
    }
}

fn checked(request: UpdateKeyStateRequest) -> Result<(KeyId, KeyState, String)> {
    let mut problems = Violations::default();
    let id = problems.take(ResourceKind::Key.parse("name", &request.name))?;
    let next = match State::try_from(request.state) {
        // Nothing leads there, which is said with the state that the key has.
        Ok(State::Active) => Some(KeyState::Active),
        Ok(State::Retired) => Some(KeyState::Retired),
        Ok(State::Revoked) => Some(KeyState::Revoked),
        Ok(State::Unspecified) | Err(_) => {
            problems.add("state", "is missing or not known");
            None
        }
    };
    problems.take(text::reason("reason", &request.reason))?;
    let told = next != Some(KeyState::Revoked) || !request.reason.is_empty();
    problems.check(told, "reason", "is missing; it is needed to revoke a key");
    problems.finish()?;
    // Both were found to be there.
    let all = id.zip(next).map(|(id, next)| (id, next, request.reason));
    all.ok_or_else(|| Error::invalid("name", "is missing"))
}
