//! Messages that tests send.
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{
    Key, KeyOutput, KeyResult, KeySpec, UploadArtifactRequest, UploadMetadata, UploadOutputRequest, VerifySpec,
    upload_artifact_request, upload_output_request,
};
use sha2::{Digest, Sha256};

pub fn sha256(bytes: &[u8]) -> String {
    hex::encode(Sha256::digest(bytes))
}

pub fn metadata(name: &str, bytes: &[u8]) -> UploadMetadata {
    UploadMetadata {
        display_name: name.into(),
        size_bytes: bytes.len() as i64,
        sha256: sha256(bytes),
    }
}

pub fn first(metadata: UploadMetadata) -> UploadArtifactRequest {
    UploadArtifactRequest {
        payload: Some(upload_artifact_request::Payload::Metadata(metadata)),
    }
}

pub fn chunk(bytes: &[u8]) -> UploadArtifactRequest {
    UploadArtifactRequest {
        payload: Some(upload_artifact_request::Payload::Chunk(bytes.to_vec())),
    }
}

pub fn output_message(payload: upload_output_request::Payload) -> UploadOutputRequest {
    UploadOutputRequest { payload: Some(payload) }
}

pub fn upload_messages(metadata: UploadMetadata, bytes: &[u8]) -> Vec<UploadArtifactRequest> {
    std::iter::once(first(metadata))
        .chain(bytes.chunks(1 << 20).map(chunk))
        .collect()
}

pub fn key_spec(bits: u32) -> Spec {
    Spec::CreateKey(KeySpec {
        bits,
        seed: None,
        ..KeySpec::default()
    })
}

pub fn verify_spec(suspect: &str, key: &str) -> Spec {
    Spec::Verify(VerifySpec {
        suspects: vec![suspect.into()],
        key: key.into(),
        ..Default::default()
    })
}

pub fn key_output(bits: u32, file: &str) -> KeyOutput {
    let key = Key {
        bits,
        clip: "a clip".into(),
        clip_sha256: sha256(b"weights"),
        ..Default::default()
    };
    KeyOutput {
        key_file: file.into(),
        key: Some(key),
        result: Some(KeyResult::default()),
    }
}
