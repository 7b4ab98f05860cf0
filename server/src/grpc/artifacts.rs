//! `ArtifactService`: scenes and pictures, in and out.
use futures::stream::{BoxStream, StreamExt};
use guardsplat_proto::v1::artifact_service_server::ArtifactService;
use guardsplat_proto::v1::{
    AppendUploadRequest, AppendUploadResponse, Artifact, DeleteArtifactRequest, DownloadArtifactRequest,
    DownloadArtifactResponse, FinishUploadRequest, GetArtifactRequest, GetDownloadUrlRequest, GetDownloadUrlResponse,
    StartUploadRequest, StartUploadResponse, UploadArtifactRequest,
};
use tonic::{Request, Response, Status, Streaming};
use uuid::Uuid;

use crate::access::Caller;
use crate::artifacts::ArtifactPath;
use crate::error::{Error, Result, chain};
use crate::grpc::download::download;
use crate::grpc::guard::caller;
use crate::grpc::upload_stream::Incoming;
use crate::ledger::{ArtifactRow, NewArtifact, Origin};
use crate::service::concurrency_limit::Permit;
use crate::service::names::ResourceKind;
use crate::service::rate_limit::payer;
use crate::service::{Service, clock, to_proto, upload};

#[tonic::async_trait]
impl ArtifactService for Service {
    async fn upload_artifact(
        &self,
        request: Request<Streaming<UploadArtifactRequest>>,
    ) -> Result<Response<Artifact>, Status> {
        let caller = caller(&request)?;
        let _permit = self.transfer(&caller)?;
        let project = caller.project;
        let incoming = Incoming::new(request.into_inner(), self.limits().upload_idle);
        let row = self.within_upload_time(self.receive_upload(project, incoming)).await?;
        self.metrics().uploaded(false, row.size);
        Ok(Response::new(to_proto::artifact(row)))
    }

    async fn start_upload(
        &self,
        request: Request<StartUploadRequest>,
    ) -> Result<Response<StartUploadResponse>, Status> {
        let project = caller(&request)?.project;
        let StartUploadRequest { metadata, in_parts } = request.into_inner();
        Ok(Response::new(self.start(&project, metadata, in_parts).await?))
    }

    async fn append_upload(
        &self,
        request: Request<AppendUploadRequest>,
    ) -> Result<Response<AppendUploadResponse>, Status> {
        let caller = caller(&request)?;
        let AppendUploadRequest { upload, offset, chunk } = request.into_inner();
        let offset = u64::try_from(offset).map_err(|_| Error::invalid("offset", "is negative"))?;
        let permit = || self.transfer(&caller);
        let received = self.append(&caller.project, &upload, offset, chunk, permit).await?;
        // No artifact is longer than a terabyte.
        let received_bytes = i64::try_from(received).unwrap_or(i64::MAX);
        Ok(Response::new(AppendUploadResponse { received_bytes }))
    }

    async fn finish_upload(&self, request: Request<FinishUploadRequest>) -> Result<Response<Artifact>, Status> {
        let caller = caller(&request)?;
        let permit = || self.transfer(&caller);
        let finished = async { Ok(self.finish(&caller.project, &request.get_ref().upload, permit).await?) };
        let (row, new) = self.within_upload_time(finished).await?;
        if new {
            self.metrics().uploaded(false, row.size);
        }
        Ok(Response::new(to_proto::artifact(row)))
    }

    type DownloadArtifactStream = BoxStream<'static, Result<DownloadArtifactResponse, Status>>;

    async fn download_artifact(
        &self,
        request: Request<DownloadArtifactRequest>,
    ) -> Result<Response<Self::DownloadArtifactStream>, Status> {
        let caller = caller(&request)?;
        let permit = self.transfer(&caller)?;
        let DownloadArtifactRequest { name, offset } = request.into_inner();
        let id = ResourceKind::Artifact.parse("name", &name)?;
        let row = self.readable_artifact(&caller, id).await?;
        let offset = u64::try_from(offset).map_err(|_| Error::invalid("offset", "is negative"))?;
        let path = ArtifactPath::parse(&row.path).map_err(Error::from)?;
        let bytes = self.store().read(&path, offset).await.map_err(Error::from)?;
        let sent = download(self, to_proto::artifact(row), bytes);
        let kept = move |message| {
            let _ = &permit;
            message
        };
        Ok(Response::new(sent.map(kept).boxed()))
    }

    async fn get_download_url(
        &self,
        request: Request<GetDownloadUrlRequest>,
    ) -> Result<Response<GetDownloadUrlResponse>, Status> {
        let id = ResourceKind::Artifact.parse("name", &request.get_ref().name)?;
        // Never a secret one: those are not even there.
        let row = self.readable_artifact(&caller(&request)?, id).await?;
        Ok(Response::new(self.signed(row).await?))
    }

    async fn get_artifact(&self, request: Request<GetArtifactRequest>) -> Result<Response<Artifact>, Status> {
        let id = ResourceKind::Artifact.parse("name", &request.get_ref().name)?;
        let row = self.owned_artifact(&caller(&request)?.project, id).await?;
        Ok(Response::new(to_proto::artifact(row)))
    }

    async fn delete_artifact(&self, request: Request<DeleteArtifactRequest>) -> Result<Response<()>, Status> {
        let id = ResourceKind::Artifact.parse("name", &request.get_ref().name)?;
        let caller = caller(&request)?;
        let row = self.owned_artifact(&caller.project, id).await?;
        self.may_delete(&caller, &row).await?;
        self.ledger()
            .delete_artifact(row.id, clock::now())
            .await
            .map_err(Error::from)?;
        let (evidence, name) = (row.evidence, row.display_name.as_str());
        tracing::info!(artifact = %row.id, project = row.project, evidence, name, by = ?caller.token, "artifact deleted");
        // It is gone for everybody from here on. What is left of it is collected later if this fails.
        if let Err(error) = self.remove_bytes(&row).await {
            tracing::warn!(artifact = %row.id, error = %chain(&error), "the bytes of a deleted artifact are left for later");
        }
        Ok(Response::new(()))
    }
}

impl Service {
    /// A permit for one more transfer of a caller. Workers move what jobs that were counted need.
    fn transfer(&self, caller: &Caller) -> Result<Option<Permit>> {
        if caller.is_worker() {
            return Ok(None);
        }
        let limit = self.limits().max_transfers;
        let permit = self.transfer_limit().take(payer(caller), limit);
        permit.map(Some).ok_or(Error::TooManyTransfers { limit })
    }

    /// An address for an artifact, where the server is to give any and the store has some.
    async fn signed(&self, row: ArtifactRow) -> Result<GetDownloadUrlResponse> {
        let (mut url, mut expire_time) = (None, None);
        if let Some(lifetime) = self.limits().signed_url {
            let path = ArtifactPath::parse(&row.path)?;
            // From before it is signed, so that it is not good for longer than is said.
            let now = clock::now();
            url = self.store().download_url(&path, lifetime).await?;
            expire_time = url
                .as_ref()
                .map(|_| clock::timestamp(now.saturating_add(clock::micros(lifetime))));
        }
        Ok(GetDownloadUrlResponse {
            artifact: Some(to_proto::artifact(row)),
            url: url.unwrap_or_default(),
            expire_time,
        })
    }

    async fn receive_upload(
        &self,
        project: String,
        mut incoming: Incoming<UploadArtifactRequest>,
    ) -> Result<ArtifactRow, Status> {
        let metadata = incoming.metadata().await?;
        let announced = upload::announced("metadata", &metadata)?;
        self.room_for_bytes(&project, announced.size).await?;
        let id = Uuid::now_v7();
        let path = ArtifactPath::upload(id);
        // The writer comes first: it refuses what is too large. It leaves nothing if it is dropped.
        let mut writer = self.store().write(&path, announced).await.map_err(Error::from)?;
        let new = NewArtifact {
            id,
            display_name: metadata.display_name,
            size: metadata.size_bytes,
            sha256: metadata.sha256,
            origin: Origin::Upload { project },
            secret: false,
            evidence: false,
            path: path.to_string(),
        };
        // The row comes before the file does, so that no file is ever without one.
        self.ledger()
            .create_artifact(new, clock::now())
            .await
            .map_err(Error::from)?;
        while let Some(chunk) = incoming.chunk().await? {
            writer.chunk(chunk).await.map_err(Error::from)?;
        }
        writer.finish().await.map_err(Error::from)?;
        Ok(self
            .ledger()
            .artifact_ready(id, None, clock::now())
            .await
            .map_err(Error::from)?)
    }
}
