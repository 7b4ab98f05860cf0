//! `KeyService`: what is known of keys. Their secrets are not here.
use guardsplat_proto::v1::key_service_server::KeyService;
use guardsplat_proto::v1::{GetKeyRequest, Key, ListKeysRequest, ListKeysResponse};
use tonic::{Request, Response, Status};

use super::names::Kind;
use super::{Api, convert, page};
use crate::error::{Error, Result};

/// What page tokens of this list are bound to.
const QUERY: &[&[u8]] = &[b"keys"];

#[tonic::async_trait]
impl KeyService for Api {
    async fn get_key(&self, request: Request<GetKeyRequest>) -> Result<Response<Key>, Status> {
        let id = Kind::Key.parse("name", &request.get_ref().name)?;
        let row = self.ledger().get_key(id).await.map_err(Error::from)?;
        Ok(Response::new(convert::key(row.ok_or_else(|| Kind::Key.not_found(id))?)))
    }

    async fn list_keys(&self, request: Request<ListKeysRequest>) -> Result<Response<ListKeysResponse>, Status> {
        let ListKeysRequest { page_size, page_token } = request.into_inner();
        let size = page::size(page_size)?;
        let before = page::position(QUERY, &page_token)?;
        // One more than asked for tells whether there is another page.
        let mut rows = self.ledger().list_keys(before, size + 1).await.map_err(Error::from)?;
        let more = rows.len() > size as usize;
        rows.truncate(size as usize);
        let last = rows.last().filter(|_| more).map(|row| (row.create_time, row.id));
        let next_page_token = last.map(|at| page::token(QUERY, at)).unwrap_or_default();
        Ok(Response::new(ListKeysResponse {
            keys: rows.into_iter().map(convert::key).collect(),
            next_page_token,
        }))
    }
}
