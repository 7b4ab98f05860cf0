//! The program as a worker of a server: what it makes of jobs, and how it ends.
mod server;
mod worker;

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::time::{Duration, Instant};

use guardsplat_proto::v1::complete_job_request::Result as Done;
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{EmbedSpec, KeySpec, VerifySpec, embed_spec::Preset};
use serde_json::Value;

use server::{Event, Server};
use worker::Bench;

/// Any port.
const ANY: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

/// A port that is free just now.
fn free() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

fn embed(scene: &str) -> EmbedSpec {
    EmbedSpec {
        scene: scene.into(),
        key: "keys/1".into(),
        message: "0123abcd".into(),
        preset: Preset::Draft.into(),
        seed: 5,
        size: 32,
        force: true,
        ..EmbedSpec::default()
    }
}

fn verify(suspects: &[&str], message: &str) -> Spec {
    Spec::Verify(VerifySpec {
        suspects: suspects.iter().map(|name| (*name).to_owned()).collect(),
        key: "keys/1".into(),
        message: message.into(),
        ..VerifySpec::default()
    })
}

/// What a job that fails says: whose fault, whether it is worth another attempt, and why.
fn failed(server: &Server) -> (Reason, bool, String) {
    match server.next(&mut Vec::new()) {
        Event::Failed(failed) => {
            assert!(!failed.cancelled);
            let failure = failed.failure.unwrap();
            (failure.reason(), failed.retryable, failure.message)
        }
        other => panic!("{other:?}"),
    }
}

fn completed(server: &Server) -> Done {
    match server.next(&mut Vec::new()) {
        Event::Completed(done) => *done,
        other => panic!("{other:?}"),
    }
}

#[test]
fn jobs_give_what_the_offline_commands_give() {
    let bench = Bench::new();
    let offline = "embed in.ply out.ply --key k.key --message 0123abcd --preset draft --seed 5 --size 32 --device cpu \
                   --force --report report --json";
    let code = 3; // the tiny CLIP sees too little for any target
    let expected: Value = serde_json::from_str(&bench.offline(offline, code)).unwrap();

    let mut server = Server::start(ANY);
    let mut worker = bench.worker(server.address);
    server.submit(Spec::CreateKey(KeySpec {
        bits: 32,
        seed: Some(7),
        ..KeySpec::default()
    }));
    let Done::KeyOutput(made) = completed(&server) else {
        panic!()
    };
    let key_file = server.bytes(&made.key_file);
    assert!(key_file == bench.read("k.key"), "another key than offline");
    let key = made.key.unwrap();
    assert_eq!((key.bits, key.clip.as_str(), key.seeded), (32, "guardsplat-2", true));
    assert_eq!(key.clip_sha256.len(), 64);
    assert_eq!(made.result.unwrap().device, "cpu");

    server.set_key(&key_file);
    let scene = server.store("robot.ply", &bench.read("in.ply"));
    server.break_download();
    server.submit(Spec::Embed(embed(&scene)));
    let mut progress = Vec::new();
    let Event::Completed(done) = server.next(&mut progress) else {
        panic!("{}", worker.log())
    };
    let Done::EmbedResult(marked) = *done else {
        panic!("{}", worker.log())
    };
    assert!(
        server.bytes(&marked.scene) == bench.read("out.ply"),
        "another scene than offline"
    );
    assert!(server.bytes(&marked.comparison) == bench.read("report/comparison.png"));
    for (field, found) in [
        ("bit_accuracy", marked.bit_accuracy),
        ("bit_accuracy_worst_view", marked.bit_accuracy_worst_view),
        ("psnr_db", marked.psnr_db.unwrap()),
        ("ssim", marked.ssim),
        ("steps", f64::from(marked.steps)),
        ("gaussians", marked.gaussians as f64),
        ("changed_gaussians", marked.changed_gaussians as f64),
    ] {
        // The last digit may go when JSON is read.
        let offline = expected[field].as_f64().unwrap();
        assert!(
            (offline - found).abs() <= 1e-12 * found.abs(),
            "{field}: {offline} offline, {found}"
        );
    }
    assert_eq!(expected["message"], marked.message);
    assert_eq!(
        expected["target_missed"].as_array().unwrap().len(),
        marked.target_missed.len()
    );
    assert!(
        progress
            .iter()
            .any(|told| told.stage() == Stage::Optimising && told.bit_accuracy.is_some())
    );

    // By scene, and by the picture of its first view; what is read matches, its complement does not.
    let verdict: Value =
        serde_json::from_str(&bench.offline("verify out.ply --key k.key --device cpu --json", 3)).unwrap();
    let read = verdict["message"].as_str().unwrap();
    server.submit(verify(&[&marked.scene], read));
    let Done::VerifyResult(found) = completed(&server) else {
        panic!()
    };
    assert_eq!(
        (found.verdict(), found.views, found.matched_bits),
        (Verdict::Match, 20, Some(32))
    );
    let logit = verdict["mean_abs_logit"].as_f64().unwrap();
    assert!(
        (found.mean_abs_logit - logit).abs() < 1e-12,
        "{logit} offline, {}",
        found.mean_abs_logit
    );
    bench.offline("render out.ply views --views 2 --size 40 --device cpu", 0);
    let pictures = ["view_000.png", "view_001.png"].map(|name| {
        let bytes = bench.read(&format!("views/{name}"));
        server.store(name, &bytes)
    });
    server.submit(verify(&[&pictures[0], &pictures[1]], ""));
    let Done::VerifyResult(found) = completed(&server) else {
        panic!()
    };
    assert_eq!(
        (found.verdict(), found.views, found.p_value),
        (Verdict::Inconclusive, 2, None)
    );

    worker.terminate();
    assert_eq!(worker.exit().code(), Some(0));
    assert_eq!(bench.left(), 0);
    let log = worker.log();
    assert!(log.contains("the cable was pulled"), "{log}");
    assert!(!log.contains("1/sboj"), "a token was logged: {log}");
}

#[test]
fn jobs_that_cannot_be_done_fail_with_their_reason() {
    let bench = Bench::new();
    let address = free();
    // Nobody is there yet: the worker waits.
    let mut worker = bench.worker(address);
    let start = Instant::now();
    while !worker.log().contains("trying again in") {
        assert!(start.elapsed() < Duration::from_secs(20), "{}", worker.log());
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut server = Server::start(address);
    server.set_key(&bench.read("k.key"));
    let scene = server.store("robot.ply", &bench.read("in.ply"));
    let text = server.store("text.ply", b"ply\nthis is no scene\n");
    let picture = server.store("holiday.png", b"this is no picture");
    let damaged = server.store_as("robot.ply", &bench.read("in.ply"), "00".repeat(32));
    // The last number of the last row.
    let mut poisoned = bench.read("in.ply");
    let last = poisoned.len() - 4;
    poisoned[last..].copy_from_slice(&f32::NAN.to_le_bytes());
    let poisoned = server.store("poisoned.ply", &poisoned);
    use Reason::{Internal, InvalidInput, TargetMissed};
    let bad_message = EmbedSpec {
        message: "5c".into(),
        ..embed(&scene)
    };
    let not_forced = EmbedSpec {
        force: false,
        ..embed(&scene)
    };
    let too_many_views = Spec::Verify(VerifySpec {
        suspects: vec![scene.clone()],
        views: 10_001,
        ..VerifySpec::default()
    });
    for (spec, reason, retryable, needle) in [
        (
            Spec::Embed(embed(&text)),
            InvalidInput,
            false,
            "text.ply (artifacts/2): ",
        ),
        (Spec::Embed(bad_message), InvalidInput, false, "32 bits"),
        (
            Spec::Embed(EmbedSpec {
                size: 4,
                ..embed(&scene)
            }),
            InvalidInput,
            false,
            "size: 4",
        ),
        (Spec::Embed(not_forced), TargetMissed, false, "bit accuracy 0."),
        (
            verify(&[&picture], ""),
            InvalidInput,
            false,
            "holiday.png (artifacts/3): not a PNG",
        ),
        (verify(&[&picture, &scene], ""), InvalidInput, false, "and not a scene"),
        (too_many_views, InvalidInput, false, "views: 10001"),
        (
            Spec::Embed(embed(&poisoned)),
            InvalidInput,
            false,
            "property rot_3 of row",
        ),
        (verify(&[&poisoned], ""), InvalidInput, false, " is NaN"),
        (
            Spec::CreateKey(KeySpec {
                bits: 151,
                seed: None,
                ..KeySpec::default()
            }),
            InvalidInput,
            false,
            "151 is outside 1 to 150",
        ),
        (Spec::Embed(embed(&damaged)), Internal, true, "was announced"),
        (Spec::Embed(embed("artifacts/none")), Internal, true, "no such artifact"),
    ] {
        server.submit(spec);
        let (found, again, message) = failed(&server);
        assert_eq!((found, again), (reason, retryable), "{message}");
        assert!(message.contains(needle), "{message}");
        assert!(!message.contains("input-"), "{message}");
    }
    // Asked to, both do without the row.
    server.submit(Spec::Embed(EmbedSpec {
        ignore_bad_rows: true,
        ..embed(&poisoned)
    }));
    let Done::EmbedResult(marked) = completed(&server) else {
        panic!()
    };
    assert_eq!(marked.ignored_rows, 1);
    server.submit(Spec::Verify(VerifySpec {
        suspects: vec![poisoned],
        key: "keys/1".into(),
        views: 2,
        ignore_bad_rows: true,
        ..VerifySpec::default()
    }));
    let Done::VerifyResult(found) = completed(&server) else {
        panic!()
    };
    assert_eq!((found.ignored_rows, found.views), (1, 2));
    // A key that is damaged is not the user's fault.
    server.set_key(b"nothing");
    server.submit(verify(&[&scene], ""));
    let (reason, _, message) = failed(&server);
    assert_eq!(reason, Internal);
    assert!(message.starts_with("key keys/1: not a key file"), "{message}");

    worker.end_stdin();
    assert_eq!(worker.exit().code(), Some(0));
    assert_eq!(bench.left(), 0);
}

#[test]
fn running_embeddings_end_when_they_are_asked_to() {
    let bench = Bench::new();
    let mut server = Server::start(ANY);
    server.set_key(&bench.read("k.key"));
    let scene = server.store("robot.ply", &bench.read("in.ply"));
    // More work than anybody waits for.
    let long = || {
        Spec::Embed(EmbedSpec {
            preset: Preset::Paper.into(),
            size: 224,
            ..embed(&scene)
        })
    };
    let mut worker = bench.worker(server.address);

    server.submit(long());
    server.wait_for(Stage::Optimising);
    let start = Instant::now();
    server.cancel();
    let Event::Failed(ended) = server.next(&mut Vec::new()) else {
        panic!()
    };
    assert!(ended.cancelled && ended.failure.is_none());
    assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());

    // Another worker was given the job: not a word about it any more, and the next one begins.
    server.submit(long());
    server.wait_for(Stage::Optimising);
    server.take_away();
    server.submit(long());
    server.wait_for(Stage::Preparing);
    server.wait_for(Stage::Optimising);

    worker.terminate();
    assert!(matches!(server.next(&mut Vec::new()), Event::Released));
    assert_eq!(worker.exit().code(), Some(0));
    assert_eq!(bench.left(), 0);

    // The same when standard input ends.
    let mut worker = bench.worker(server.address);
    server.submit(long());
    server.wait_for(Stage::Optimising);
    worker.end_stdin();
    assert!(matches!(server.next(&mut Vec::new()), Event::Released));
    assert_eq!(worker.exit().code(), Some(0));
}

#[test]
fn bad_options_are_told() {
    let bench = Bench::new();
    for (line, needle) in [
        ("run --server localhost:50051 --device cpu", "--server: "),
        (
            "run --server ftp://localhost --device cpu",
            "must begin with http:// or https://",
        ),
        ("run --server http://127.0.0.1:9 --device cpu --work-dir none", "none"),
    ] {
        let told = bench.fails(line);
        assert!(told.starts_with("error: ") && told.contains(needle), "{line}: {told}");
    }
}
