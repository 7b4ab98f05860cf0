//! Owners, assets and commitments.
use guardsplat_proto::v1::registry_service_server::RegistryService;
use guardsplat_proto::v1::{
    Asset, Commitment, CreateAssetRequest, CreateOwnerRequest, ExportCommitmentRequest, ExportCommitmentResponse,
    GetAssetRequest, GetCommitmentRequest, GetHeadRequest, GetOwnerRequest, GetPublicKeyRequest, ListAssetsRequest,
    ListAssetsResponse, ListCommitmentsRequest, ListCommitmentsResponse, ListOwnersRequest, ListOwnersResponse, Owner,
    PublicKey, RevealCommitmentRequest, RevealCommitmentResponse,
};
use tonic::{Request, Response, Status};
use uuid::Uuid;

use super::super::fake::Fake;
use super::not_found;

#[tonic::async_trait]
impl RegistryService for Fake {
    async fn create_owner(&self, request: Request<CreateOwnerRequest>) -> Result<Response<Owner>, Status> {
        let mut owner = request.into_inner().owner.unwrap();
        owner.name = format!("owners/{}", Uuid::new_v4());
        self.state().owners.insert(0, owner.clone());
        Ok(Response::new(owner))
    }

    async fn get_owner(&self, request: Request<GetOwnerRequest>) -> Result<Response<Owner>, Status> {
        let name = request.into_inner().name;
        let owner = self.state().owners.iter().find(|owner| owner.name == name).cloned();
        owner.map(Response::new).ok_or_else(|| not_found(&name))
    }

    async fn list_owners(&self, _: Request<ListOwnersRequest>) -> Result<Response<ListOwnersResponse>, Status> {
        Ok(Response::new(ListOwnersResponse {
            owners: self.state().owners.clone(),
            next_page_token: String::new(),
        }))
    }

    async fn create_asset(&self, request: Request<CreateAssetRequest>) -> Result<Response<Asset>, Status> {
        let mut asset = request.into_inner().asset.unwrap();
        asset.name = format!("assets/{}", Uuid::new_v4());
        self.state().registered.push(asset.clone());
        Ok(Response::new(asset))
    }

    async fn get_asset(&self, request: Request<GetAssetRequest>) -> Result<Response<Asset>, Status> {
        let name = request.into_inner().name;
        let asset = self.state().registered.iter().find(|asset| asset.name == name).cloned();
        asset.map(Response::new).ok_or_else(|| not_found(&name))
    }

    async fn list_assets(&self, request: Request<ListAssetsRequest>) -> Result<Response<ListAssetsResponse>, Status> {
        let ListAssetsRequest { owner, key, .. } = request.into_inner();
        let wanted =
            |asset: &&Asset| (owner.is_empty() || asset.owner == owner) && (key.is_empty() || asset.key == key);
        Ok(Response::new(ListAssetsResponse {
            assets: self.state().registered.iter().rev().filter(wanted).cloned().collect(),
            next_page_token: String::new(),
        }))
    }

    async fn get_commitment(&self, _: Request<GetCommitmentRequest>) -> Result<Response<Commitment>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn list_commitments(
        &self,
        _: Request<ListCommitmentsRequest>,
    ) -> Result<Response<ListCommitmentsResponse>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn get_head(&self, _: Request<GetHeadRequest>) -> Result<Response<Commitment>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn export_commitment(
        &self,
        _: Request<ExportCommitmentRequest>,
    ) -> Result<Response<ExportCommitmentResponse>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn reveal_commitment(
        &self,
        request: Request<RevealCommitmentRequest>,
    ) -> Result<Response<RevealCommitmentResponse>, Status> {
        let opened = self.state().opened.clone();
        let document = opened.ok_or_else(|| not_found(&request.into_inner().name))?;
        Ok(Response::new(RevealCommitmentResponse {
            document,
            reveal_time: Some(prost_types::Timestamp {
                seconds: 1_800_000_000,
                nanos: 0,
            }),
        }))
    }

    async fn get_public_key(&self, _: Request<GetPublicKeyRequest>) -> Result<Response<PublicKey>, Status> {
        Ok(Response::new(PublicKey {
            hex: self.state().public_key.clone(),
            pem: "-----BEGIN PUBLIC KEY-----".into(),
        }))
    }
}
