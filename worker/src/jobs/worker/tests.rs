//! How a worker ends whose engine is lost.
use guardsplat_proto::connect::Target;
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{KeySpec, VerifySpec};

use super::*;
use crate::jobs::shutdown;
use guardsplat_engine::device::DeviceChoice;

#[allow(dead_code)] // the other tests use the rest
#[path = "../../../tests/jobs/server.rs"]
mod server;

use server::Event;

async fn worker(server: &server::Server, folder: &std::path::Path) -> Worker {
    let (accelerator, _) = Accelerator::start(DeviceChoice::Cpu, None).await.unwrap();
    Worker {
        server: Server::new(&Target {
            url: format!("http://{}", server.address),
            ..Target::default()
        })
        .unwrap(),
        leaving: shutdown::listen(false).unwrap(),
        folder: WorkDirectory::new(folder).unwrap(),
        accelerator,
        capabilities: WorkerCapabilities::new("test".into(), "cpu", None),
        certificate: crate::credentials_program::Certificate::default(),
    }
}

#[tokio::test]
async fn a_panic_fails_the_job_and_ends_the_worker() {
    let mut server = server::Server::start(([127, 0, 0, 1], 0).into());
    let folder = tempfile::tempdir().unwrap();
    let mut worker = worker(&server, folder.path()).await;
    // The first job fails by itself, and the worker goes on.
    server.submit(Spec::Verify(VerifySpec::default()));
    server.submit(Spec::CreateKey(KeySpec {
        bits: 8,
        seed: None,
        ..KeySpec::default()
    }));
    let (lease, job) = worker.lease().await.unwrap().unwrap();
    worker.attempt(&lease, &job).await.unwrap();
    let failed = |server: &server::Server| match server.next(&mut Vec::new()) {
        Event::Failed(failed) => (failed.failure.unwrap(), failed.retryable),
        other => panic!("{other:?}"),
    };
    assert!(!failed(&server).1);
    // The second finds an engine that is gone.
    let lost: Result<()> = worker.accelerator.run(|_| panic!("device on fire")).await;
    assert!(lost.is_err());
    let ended = worker.serve().await.unwrap_err();
    assert!(matches!(ended, Error::Panicked(_)), "{ended}");
    let (failure, retryable) = failed(&server);
    assert!(retryable && failure.reason() == Reason::Internal, "{failure:?}");
    assert!(failure.message.starts_with("the engine panicked: "), "{failure:?}");
}
