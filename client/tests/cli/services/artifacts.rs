//! Uploads and downloads.
use guardsplat_proto::v1::artifact_service_server::ArtifactService;
use guardsplat_proto::v1::{
    AppendUploadRequest, AppendUploadResponse, Artifact, DeleteArtifactRequest, DownloadArtifactRequest,
    DownloadArtifactResponse, FinishUploadRequest, GetArtifactRequest, GetDownloadUrlRequest, GetDownloadUrlResponse,
    HttpHeader, StartUploadRequest, StartUploadResponse, UploadArtifactRequest, download_artifact_response,
    upload_artifact_request,
};
use sha2::{Digest, Sha256};
use tonic::{Request, Response, Status, Streaming};
use uuid::Uuid;

use super::super::fake::Fake;
use super::{Replies, not_found, replies};

#[tonic::async_trait]
impl ArtifactService for Fake {
    async fn upload_artifact(
        &self,
        request: Request<Streaming<UploadArtifactRequest>>,
    ) -> Result<Response<Artifact>, Status> {
        self.state().uploads += 1;
        let mut stream = request.into_inner();
        let first = stream.message().await?.and_then(|message| message.payload);
        let Some(upload_artifact_request::Payload::Metadata(metadata)) = first else {
            return Err(Status::invalid_argument("metadata must come first"));
        };
        let error = self.state().upload_errors.pop_front();
        if let Some(error) = error {
            return Err(error);
        }
        let (mut bytes, mut chunks) = (Vec::new(), Vec::new());
        while let Some(message) = stream.message().await? {
            let Some(upload_artifact_request::Payload::Chunk(chunk)) = message.payload else {
                return Err(Status::invalid_argument("a chunk must come"));
            };
            chunks.push(chunk.len());
            bytes.extend(chunk);
        }
        if metadata.size_bytes != bytes.len() as i64 || metadata.sha256 != hex::encode(Sha256::digest(&bytes)) {
            return Err(Status::invalid_argument("these are other bytes"));
        }
        let name = self.store(&metadata.display_name, &bytes);
        let mut state = self.state();
        state.chunks = chunks;
        Ok(Response::new(state.artifacts[&name].0.clone()))
    }

    async fn start_upload(
        &self,
        request: Request<StartUploadRequest>,
    ) -> Result<Response<StartUploadResponse>, Status> {
        let metadata = request.into_inner().metadata.unwrap();
        let mut state = self.state();
        let Some(begin) = state.addresses_to_write.clone() else {
            return Ok(Response::new(StartUploadResponse::default()));
        };
        let upload = format!("uploads/{}", Uuid::new_v4());
        state.begun.insert(upload.clone(), (metadata, None));
        let header = HttpHeader {
            name: "x-ms-blob-type".into(),
            value: "BlockBlob".into(),
        };
        Ok(Response::new(StartUploadResponse {
            url: format!("{begin}/{upload}"),
            upload,
            headers: vec![header],
            expire_time: None,
        }))
    }

    async fn append_upload(&self, _: Request<AppendUploadRequest>) -> Result<Response<AppendUploadResponse>, Status> {
        Err(Status::unimplemented("for browsers"))
    }

    async fn finish_upload(&self, request: Request<FinishUploadRequest>) -> Result<Response<Artifact>, Status> {
        let upload = request.into_inner().upload;
        let (metadata, finished) = self.state().begun[&upload].clone();
        let bytes = self.state().put.clone();
        self.state().finishes += 1;
        let name = match finished {
            Some(name) => name,
            None if metadata.sha256 == hex::encode(Sha256::digest(&bytes)) => {
                self.store(&metadata.display_name, &bytes)
            }
            None => return Err(Status::invalid_argument("these are other bytes")),
        };
        let mut state = self.state();
        state.begun.insert(upload, (metadata, Some(name.clone())));
        match state.finish_errors.pop_front() {
            Some(error) => Err(error),
            None => Ok(Response::new(state.artifacts[&name].0.clone())),
        }
    }

    type DownloadArtifactStream = Replies<DownloadArtifactResponse>;

    async fn download_artifact(
        &self,
        request: Request<DownloadArtifactRequest>,
    ) -> Result<Response<Self::DownloadArtifactStream>, Status> {
        let request = request.into_inner();
        let mut state = self.state();
        state.offsets.push(request.offset);
        let found = state.artifacts.get(&request.name).cloned();
        let (artifact, mut bytes) = found.ok_or_else(|| not_found(&request.name))?;
        if state.damage {
            bytes[0] ^= 1;
        }
        let mut rest = bytes.split_off(request.offset as usize);
        let end = state.download_ends.pop_front();
        if let Some(end) = end {
            rest.truncate(end);
        }
        use download_artifact_response::Payload;
        let respond = |payload| Ok(DownloadArtifactResponse { payload: Some(payload) });
        let mut items = vec![respond(Payload::Artifact(artifact))];
        items.extend(
            rest.chunks(100_000)
                .map(|chunk| respond(Payload::Chunk(chunk.to_vec()))),
        );
        if end.is_some() {
            items.push(Err(Status::unavailable("going down")));
        }
        Ok(Response::new(replies(items)))
    }

    async fn get_download_url(
        &self,
        request: Request<GetDownloadUrlRequest>,
    ) -> Result<Response<GetDownloadUrlResponse>, Status> {
        let name = request.into_inner().name;
        let state = self.state();
        let (artifact, _) = state.artifacts.get(&name).ok_or_else(|| not_found(&name))?;
        let address = state.addresses.as_ref();
        Ok(Response::new(GetDownloadUrlResponse {
            artifact: Some(artifact.clone()),
            url: address.map(|begin| format!("{begin}/{name}")).unwrap_or_default(),
            expire_time: None,
        }))
    }

    async fn get_artifact(&self, request: Request<GetArtifactRequest>) -> Result<Response<Artifact>, Status> {
        Err(Status::unimplemented(request.into_inner().name))
    }

    async fn delete_artifact(&self, request: Request<DeleteArtifactRequest>) -> Result<Response<()>, Status> {
        let name = request.into_inner().name;
        let mut state = self.state();
        state.deleted.push(name.clone());
        state
            .artifacts
            .remove(&name)
            .map(|_| Response::new(()))
            .ok_or_else(|| not_found(&name))
    }
}
