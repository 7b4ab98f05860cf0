//! Keys.
use guardsplat_proto::v1::key_service_server::KeyService;
use guardsplat_proto::v1::{GetKeyRequest, Key, ListKeysRequest, ListKeysResponse, UpdateKeyStateRequest};
use tonic::{Request, Response, Status};

use super::super::fake::Fake;
use super::not_found;

#[tonic::async_trait]
impl KeyService for Fake {
    async fn get_key(&self, request: Request<GetKeyRequest>) -> Result<Response<Key>, Status> {
        let name = request.into_inner().name;
        let key = self.state().keys.iter().find(|key| key.name == name).cloned();
        key.map(Response::new).ok_or_else(|| not_found(&name))
    }

    async fn list_keys(&self, request: Request<ListKeysRequest>) -> Result<Response<ListKeysResponse>, Status> {
        let from: usize = request.into_inner().page_token.parse().unwrap_or(0);
        let keys = &self.state().keys;
        let to = (from + 2).min(keys.len());
        Ok(Response::new(ListKeysResponse {
            keys: keys[from..to].to_vec(),
            next_page_token: if to < keys.len() { to.to_string() } else { String::new() },
        }))
    }

    async fn update_key_state(&self, _: Request<UpdateKeyStateRequest>) -> Result<Response<Key>, Status> {
        Err(Status::unimplemented("no test changes a key's state"))
    }
}
