//! `RegistryService`: who owns which original, and what was signed about it.
use guardsplat_proto::v1::registry_service_server::RegistryService;
use guardsplat_proto::v1::{
    Asset, Commitment, CreateAssetRequest, CreateOwnerRequest, ExportCommitmentRequest, ExportCommitmentResponse,
    GetAssetRequest, GetCommitmentRequest, GetHeadRequest, GetOwnerRequest, GetPublicKeyRequest, ListAssetsRequest,
    ListAssetsResponse, ListCommitmentsRequest, ListCommitmentsResponse, ListOwnersRequest, ListOwnersResponse, Owner,
    PublicKey, RevealCommitmentRequest, RevealCommitmentResponse,
};
use tonic::{Request, Response, Status};

use crate::grpc::guard::caller;
use crate::service::Service;
use crate::service::registry::commitments;

#[tonic::async_trait]
impl RegistryService for Service {
    async fn create_owner(&self, request: Request<CreateOwnerRequest>) -> Result<Response<Owner>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.register_owner(project, request.into_inner()).await?))
    }

    async fn get_owner(&self, request: Request<GetOwnerRequest>) -> Result<Response<Owner>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.owner(&project, &request.get_ref().name).await?))
    }

    async fn list_owners(&self, request: Request<ListOwnersRequest>) -> Result<Response<ListOwnersResponse>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.page_of_owners(&project, request.get_ref()).await?))
    }

    async fn create_asset(&self, request: Request<CreateAssetRequest>) -> Result<Response<Asset>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.register_asset(project, request.into_inner()).await?))
    }

    async fn get_asset(&self, request: Request<GetAssetRequest>) -> Result<Response<Asset>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.asset(&project, &request.get_ref().name).await?))
    }

    async fn list_assets(&self, request: Request<ListAssetsRequest>) -> Result<Response<ListAssetsResponse>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.page_of_assets(&project, request.get_ref()).await?))
    }

    async fn get_commitment(&self, request: Request<GetCommitmentRequest>) -> Result<Response<Commitment>, Status> {
        let project = caller(&request)?.project;
        let signed = self.commitment(&project, &request.get_ref().name).await?;
        Ok(Response::new(commitments::to_proto(&signed)))
    }

    async fn list_commitments(
        &self,
        request: Request<ListCommitmentsRequest>,
    ) -> Result<Response<ListCommitmentsResponse>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(
            self.page_of_commitments(&project, request.get_ref()).await?,
        ))
    }

    async fn get_head(&self, request: Request<GetHeadRequest>) -> Result<Response<Commitment>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.head(&project).await?))
    }

    async fn export_commitment(
        &self,
        request: Request<ExportCommitmentRequest>,
    ) -> Result<Response<ExportCommitmentResponse>, Status> {
        let project = caller(&request)?.project;
        let document = self.document(&project, &request.get_ref().name).await?;
        Ok(Response::new(ExportCommitmentResponse { document }))
    }

    async fn reveal_commitment(
        &self,
        request: Request<RevealCommitmentRequest>,
    ) -> Result<Response<RevealCommitmentResponse>, Status> {
        let caller = caller(&request)?;
        let name = &request.get_ref().name;
        let answer = self.reveal(&caller.project, name).await?;
        tracing::info!(commitment = name, project = caller.project, by = ?caller.token, "commitment opened: its asset's word is no secret any more");
        Ok(Response::new(answer))
    }

    async fn get_public_key(&self, _: Request<GetPublicKeyRequest>) -> Result<Response<PublicKey>, Status> {
        Ok(Response::new(self.public_key()?))
    }
}
