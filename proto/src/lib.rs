//! The GuardSplat API, compiled from `proto/guardsplat/v1`.

#[cfg(feature = "connect")]
pub mod connect;

/// Messages, clients and servers of `guardsplat.v1`.
#[allow(missing_docs, clippy::all)] // generated; the .proto files are documented
pub mod v1 {
    tonic::include_proto!("guardsplat.v1");
}

/// All files as a `google.protobuf.FileDescriptorSet`, for server reflection.
pub const FILE_DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/guardsplat.bin"));
