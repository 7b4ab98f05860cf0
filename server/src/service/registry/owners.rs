//! Owners: registered, looked at, listed.
use guardsplat_proto::v1::{CreateOwnerRequest, ListOwnersRequest, ListOwnersResponse, Owner};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::ledger::{NewOwner, OwnerRow};
use crate::service::clock::{self, timestamp};
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{Service, ownership, page, submission, text};

/// What page tokens of this list are bound to.
const QUERY: &[&[u8]] = &[b"owners"];

impl Service {
    pub(crate) async fn register_owner(&self, project: String, request: CreateOwnerRequest) -> Result<Owner> {
        let (display_name, asked) = checked(request)?;
        let new = NewOwner {
            id: Uuid::now_v7(),
            request_id: asked.map(|id| ownership::request(&project, id)),
            project,
            display_name,
        };
        let row = self.ledger().create_owner(new, clock::now()).await;
        Ok(message(row.map_err(|error| ownership::as_asked(error, asked))?))
    }

    pub(crate) async fn owner(&self, project: &str, name: &str) -> Result<Owner> {
        let id = ResourceKind::Owner.parse("name", name)?;
        Ok(message(self.owned_owner(project, id).await?))
    }

    pub(crate) async fn page_of_owners(
        &self,
        project: &str,
        request: &ListOwnersRequest,
    ) -> Result<ListOwnersResponse> {
        let size = page::size(request.page_size)?;
        let before = page::position(QUERY, &request.page_token)?;
        // One more than asked for tells whether there is another page.
        let rows = self.ledger().list_owners(project, before, size + 1).await?;
        let (rows, next_page_token) = page::cut(QUERY, rows, size, |row| (row.create_time, row.id));
        Ok(ListOwnersResponse {
            owners: rows.into_iter().map(message).collect(),
            next_page_token,
        })
    }
}

/// The display name, and what the request is called.
fn checked(request: CreateOwnerRequest) -> Result<(String, Option<Uuid>)> {
    let CreateOwnerRequest { owner, request_id } = request;
    let owner = owner.ok_or_else(|| Error::invalid("owner", "is missing"))?;
    let mut problems = Violations::default();
    let request_id = problems.take(submission::request_id(&request_id))?.flatten();
    problems.check(!owner.display_name.is_empty(), "owner.display_name", "is missing");
    problems.take(text::display_name("owner.display_name", &owner.display_name))?;
    for (field, empty) in [
        ("owner.name", owner.name.is_empty()),
        ("owner.create_time", owner.create_time.is_none()),
    ] {
        problems.check(empty, field, "is set by the server and must be empty");
    }
    problems.finish()?;
    Ok((owner.display_name, request_id))
}

fn message(row: OwnerRow) -> Owner {
    Owner {
        name: ResourceKind::Owner.name(row.id),
        display_name: row.display_name,
        create_time: Some(timestamp(row.create_time)),
    }
}
