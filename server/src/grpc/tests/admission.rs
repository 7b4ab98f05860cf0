//! Scenes that take more memory than a job may are refused when they are submitted, and nothing else is for it.
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{EmbedSpec, Job, VerifySpec};
use tonic::{Code, Response, Status};
use uuid::Uuid;

use super::harness::{Server, not_found, refused, verify_spec};
use crate::service::Limits;

/// Gaussians of the scenes below: 1.6 MiB of file, as much again in memory, and twice that to be marked.
const GAUSSIANS: usize = 30_000;

fn up_to(mebibytes: u64) -> Limits {
    Limits {
        max_job_memory: Some(mebibytes << 20),
        ..Limits::default()
    }
}

/// A PLY of degree 0 whose Gaussians are all zero.
pub fn ply(promised: usize, there: usize) -> Vec<u8> {
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {promised}\n");
    for name in names.split(' ') {
        header += &format!("property float {name}\n");
    }
    let mut bytes = (header + "end_header\n").into_bytes();
    bytes.resize(bytes.len() + 56 * there, 0);
    bytes
}

pub fn embed(scene: &str, key: &str) -> Job {
    let spec = EmbedSpec {
        scene: scene.into(),
        key: key.into(),
        message: "beef".into(),
        ..Default::default()
    };
    Job {
        spec: Some(Spec::Embed(spec)),
        ..Default::default()
    }
}

fn verify(suspect: &str, key: &str) -> Job {
    Job {
        spec: Some(verify_spec(suspect, key)),
        ..Default::default()
    }
}

#[track_caller]
fn does_not_fit(answer: Result<Response<Job>, Status>) -> (String, Vec<String>) {
    let text = answer
        .as_ref()
        .map_or_else(|status| status.message().to_owned(), |_| String::new());
    let details = refused(answer, Code::FailedPrecondition, "SCENE_DOES_NOT_FIT");
    let info = details.error_info().unwrap();
    let fields = [
        "name",
        "gaussians",
        "sh_degree",
        "needed_bytes",
        "likely_bytes",
        "limit_bytes",
    ];
    let violation = &details.precondition_failure().unwrap().violations[0];
    assert_eq!(violation.subject, info.metadata["name"]);
    (text, fields.map(|field| info.metadata[field].clone()).to_vec())
}

#[tokio::test]
async fn a_scene_that_cannot_fit_is_refused_with_the_numbers() {
    let server = Server::with(up_to(6)).await;
    let key = server.key(16, b"key file").await;
    let file = ply(GAUSSIANS, GAUSSIANS);
    let scene = server.upload("scene.ply", &file).await.name;
    let (text, numbers) = does_not_fit(server.submit(embed(&scene, &key), "").await);
    let needed = (2 * (file.len() + 56 * GAUSSIANS)).to_string();
    assert_eq!(
        numbers,
        [&scene, "30000", "0", &needed, &needed, &(6 << 20).to_string()]
    );
    let words = "30000 Gaussians with spherical harmonics of degree 0 take 7 MiB of memory at least; a job may take 6 MiB \
                 (max_job_memory_mebibytes)";
    assert_eq!(text, format!("{scene} does not fit: {words}"));
    // It was not queued; and to be read it takes only half as much.
    assert_eq!(server.lease(std::time::Duration::ZERO).await.job, None);
    server.submit(verify(&scene, &key), "").await.unwrap();

    let server = server.restart(up_to(3)).await;
    does_not_fit(server.submit(verify(&scene, &key), "").await);
    let server = server.restart(up_to(7)).await;
    server.submit(embed(&scene, &key), "").await.unwrap();
    let server = server.restart(Limits::default()).await;
    server.submit(embed(&scene, &key), "").await.unwrap();
}

/// Jobs of one scene do not wait for the store each.
#[tokio::test]
async fn a_scene_is_looked_at_once() {
    let server = Server::with(up_to(6)).await;
    let key = server.key(16, b"key file").await;
    let before = server.files();
    let scene = server.upload("scene.ply", &ply(GAUSSIANS, GAUSSIANS)).await.name;
    let first = does_not_fit(server.submit(embed(&scene, &key), "").await);
    let files = server.files();
    let new: Vec<_> = files.iter().filter(|file| !before.contains(file)).collect();
    assert_eq!(new.len(), 1);
    std::fs::remove_file(new[0]).unwrap();
    assert_eq!(does_not_fit(server.submit(embed(&scene, &key), "").await), first);
    // A server that did not see it can't say.
    let server = server.restart(up_to(6)).await;
    server.submit(embed(&scene, &key), "").await.unwrap();
}

/// What it is is said by those who read all of it.
#[tokio::test]
async fn what_is_not_clearly_a_large_scene_is_taken() {
    let server = Server::with(up_to(1)).await;
    let key = server.key(16, b"key file").await;
    let large = vec![7; 3 << 20];
    let picture = [
        &b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x01\0\0\0\x01\0\x08\x06"[..],
        &large,
    ]
    .concat();
    let zip = [&b"PK\x03\x04"[..], &large].concat();
    for (name, bytes) in [
        ("hardly anything", &[7][..]),
        ("words", b"scene"),
        ("promises", &ply(400_000_000, GAUSSIANS)),
        ("header", &ply(GAUSSIANS, 0)[..100]),
        ("picture", &picture),
        ("sevens", &large),
        ("archive", &zip),
        ("small", &ply(4000, 4000)),
    ] {
        let artifact = server.upload(name, bytes).await.name;
        for job in [embed(&artifact, &key), verify(&artifact, &key)] {
            assert!(server.submit(job, "").await.is_ok(), "{name}");
        }
    }
    // Among other suspects a scene is no scene.
    let file = ply(GAUSSIANS, GAUSSIANS);
    let scene = server.upload("scene.ply", &file).await.name;
    does_not_fit(server.submit(verify(&scene, &key), "").await);
    let mut suspects = vec![scene, server.upload("a.png", &picture).await.name];
    let several = |suspects: &[String]| Job {
        spec: Some(Spec::Verify(VerifySpec {
            suspects: suspects.to_vec(),
            key: key.clone(),
            ..Default::default()
        })),
        ..Default::default()
    };
    server.submit(several(&suspects), "").await.unwrap();
    // One that is not there is told as such.
    suspects = vec![format!("artifacts/{}", Uuid::now_v7())];
    assert_eq!(not_found(server.submit(several(&suspects), "").await), suspects[0]);
}

/// A job that a request made stays what the request gives, whatever the limit has become.
#[tokio::test]
async fn a_request_sent_again_is_not_refused() {
    let server = Server::with(up_to(7)).await;
    let key = server.key(16, b"key file").await;
    let scene = server.upload("scene.ply", &ply(GAUSSIANS, GAUSSIANS)).await.name;
    let [id, other] = [(); 2].map(|()| Uuid::new_v4().to_string());
    let first = server.submit(embed(&scene, &key), &id).await.unwrap().into_inner();
    let server = server.restart(up_to(1)).await;
    let again = server.submit(embed(&scene, &key), &id).await.unwrap().into_inner();
    assert_eq!(again.name, first.name);
    refused(
        server.submit(verify(&scene, &key), &id).await,
        Code::AlreadyExists,
        "REQUEST_ID_REUSED",
    );
    // One that was refused made nothing, and may be taken later.
    does_not_fit(server.submit(embed(&scene, &key), &other).await);
    let server = server.restart(up_to(7)).await;
    let taken = server.submit(embed(&scene, &key), &other).await.unwrap().into_inner();
    assert_ne!(taken.name, first.name);
}
