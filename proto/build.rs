//! Compiles the API with a compiler written in Rust, so that no protoc is needed.
use std::error::Error;
use std::path::PathBuf;

const FILES: [&str; 8] = [
    "guardsplat/v1/artifact_service.proto",
    "guardsplat/v1/hook_service.proto",
    "guardsplat/v1/job.proto",
    "guardsplat/v1/job_service.proto",
    "guardsplat/v1/key_service.proto",
    "guardsplat/v1/registry_service.proto",
    "guardsplat/v1/token_service.proto",
    "guardsplat/v1/worker_service.proto",
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=guardsplat");
    let descriptors = protox::compile(FILES, ["."])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("guardsplat.bin"), prost::Message::encode_to_vec(&descriptors))?;
    tonic_prost_build::configure().compile_fds(descriptors)?;
    Ok(())
}
