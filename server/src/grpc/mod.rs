//! The API over gRPC: the seven services of `guardsplat.v1`, and the layers that every call goes through.
use guardsplat_proto::v1::artifact_service_server::ArtifactServiceServer;
use guardsplat_proto::v1::hook_service_server::HookServiceServer;
use guardsplat_proto::v1::job_service_server::JobServiceServer;
use guardsplat_proto::v1::key_service_server::KeyServiceServer;
use guardsplat_proto::v1::registry_service_server::RegistryServiceServer;
use guardsplat_proto::v1::token_service_server::TokenServiceServer;
use guardsplat_proto::v1::worker_service_server::WorkerServiceServer;
use tonic::Status;
use tonic::service::Routes;

use crate::artifacts::CHUNK_BYTES;
use crate::error::{Error, Result};
use crate::service::Service;

mod around;
mod artifacts;
mod connection;
mod connections;
mod deadline;
mod download;
#[doc(hidden)]
pub mod fuzz_api;
pub mod guard;
mod hooks;
mod jobs;
mod keys;
pub mod listener;
pub mod metrics_layer;
mod outputs;
mod prefaced;
mod registry;
mod slow_consumer;
mod status;
#[cfg(test)]
pub(crate) mod tests;
mod token_memory;
mod tokens;
mod transport_errors;
mod upload_stream;
mod watch;
mod worker;

/// Largest message that is read, as tonic has it by default: large things never travel in one message.
const MAX_MESSAGE: usize = 4 << 20;
/// The same for messages of uploads: a chunk and what is around it. Of a message that has not arrived whole, the part that
/// has is in memory.
const MAX_UPLOAD_MESSAGE: usize = CHUNK_BYTES + (64 << 10);

impl Service {
    /// The seven services and reflection. Health, which knows more than the API, is added by the caller.
    pub fn routes(&self) -> Result<Routes> {
        let reflection = || {
            tonic_reflection::server::Builder::configure()
                .register_encoded_file_descriptor_set(guardsplat_proto::FILE_DESCRIPTORS)
                .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
                .register_encoded_file_descriptor_set(tonic_types::pb::FILE_DESCRIPTOR_SET)
        };
        let failed = |error| Error::internal("setting up reflection", error);
        Ok(
            Routes::new(JobServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(ArtifactServiceServer::new(self.clone()).max_decoding_message_size(MAX_UPLOAD_MESSAGE))
                .add_service(KeyServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(RegistryServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(TokenServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(HookServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(WorkerServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(reflection().build_v1().map_err(failed)?)
                .add_service(reflection().build_v1alpha().map_err(failed)?),
        )
    }

    /// What counts and traces calls, for the listener.
    pub fn measured(&self) -> metrics_layer::MetricsLayer {
        metrics_layer::MetricsLayer {
            metrics: self.metrics(),
            traces: self.traces().clone(),
        }
    }

    /// Breaks off an upload that takes so long that its bytes would count as abandoned.
    async fn within_upload_time<T>(&self, upload: impl Future<Output = Result<T, Status>>) -> Result<T, Status> {
        let longest = self.limits().abandoned_after;
        let done = tokio::time::timeout(longest, upload).await;
        done.map_err(|_| Error::UploadTooSlow(longest))?
    }
}
