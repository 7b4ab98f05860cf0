//! A scene goes in, a marked one comes out, and a suspect is recognised; all as without a server.
use std::time::Duration;

use guardsplat_tests::{Service, TestEnvironment, real_scene};
use serde_json::Value;

use crate::{EMBED, KEY, MISSED, environment, offline};

/// Fields of a verdict that have to be the same, whoever computes it.
const VERDICT: [&str; 10] = [
    "verdict",
    "p_value",
    "threshold",
    "matched_bits",
    "rank_sum",
    "needed_rank_sum",
    "bits",
    "views",
    "message",
    "bit_accuracy",
];

/// Verifies offline and through the service, which must agree.
#[track_caller]
fn verifies(service: &Service, path: &str, message: &str, code: i32) -> Value {
    let (offline, line) = (
        service.environment.json(
            &format!("verify {path} --key k.key --message {message} --device cpu --json"),
            code,
        ),
        format!("verify {path} --key site --message {message}"),
    );
    let online = service.json(&line, code);
    for field in VERDICT {
        assert_eq!(online[field], offline[field], "{field} of {line}");
    }
    online
}

/// The message that the key reads from scene or pictures.
fn reading(environment: &TestEnvironment, path: &str) -> String {
    let read = environment.json(&format!("verify {path} --key k.key --device cpu --json"), 3);
    read["message"].as_str().unwrap().into()
}

fn opposite(message: &str) -> String {
    format!("{:08x}", !u32::from_str_radix(message, 16).unwrap())
}

#[test]
fn one_server_and_the_client_are_enough() {
    let environment = environment();
    let expected = offline(&environment, "draft");
    let mut service = Service::start(environment, "--embedded-worker true");
    let made = service.json(KEY, 0);
    assert_eq!((&made["seeded"], &made["bits"]), (&true.into(), &32.into()));
    let keys = service.json("key list", 0);
    assert_eq!(keys["keys"][0]["name"], made["key"]);

    let marked = service.json(&format!("{EMBED} draft -o out.ply --comparison comparison.png"), MISSED);
    assert!(service.environment.read("out.ply") == service.environment.read("expected.ply"));
    assert!(service.environment.read("comparison.png") == service.environment.read("report/comparison.png"));
    for field in [
        "written",
        "steps",
        "psnr_db",
        "bit_accuracy",
        "message",
        "target_missed",
    ] {
        assert_eq!(marked[field], expected[field], "{field}");
    }

    // The scene, and five pictures of it that somebody else might have made.
    let read = reading(&service.environment, "out.ply");
    assert_eq!(verifies(&service, "out.ply", &read, 0)["views"], 20);
    verifies(&service, "out.ply", &opposite(&read), 2);
    service
        .environment
        .exits("render out.ply views --views 5 --size 64 --device cpu", 0);
    let read = reading(&service.environment, "views");
    assert_eq!(verifies(&service, "views", &read, 0)["views"], 5);
    verifies(&service, "views", &opposite(&read), 2);

    // A row with NaN is an error, unless it is to be left out: here the last, which ends with a rotation.
    let mut poisoned = service.environment.read("in.ply");
    let last = poisoned.len() - 4;
    poisoned[last..].copy_from_slice(&f32::NAN.to_le_bytes());
    service.environment.write("nan.ply", &poisoned);
    let error = &service.json("verify nan.ply --key site", 1)["error"];
    assert_eq!(error["reason"], "invalid_input", "{error}");
    assert!(error["message"].as_str().unwrap().contains("row 499 is NaN"), "{error}");
    let read = reading(&service.environment, "nan.ply --ignore-bad-rows");
    assert_eq!(
        verifies(&service, "nan.ply --ignore-bad-rows", &read, 0)["ignored_rows"],
        1
    );
    let embed = EMBED.replace("in.ply", "nan.ply --ignore-bad-rows");
    let marked = service.json(&format!("{embed} draft -o nan-out.ply"), MISSED);
    assert_eq!(
        (&marked["ignored_rows"], &marked["gaussians"]),
        (&1.into(), &499.into())
    );

    // A target that is missed is no result, unless it was forced.
    let missed = service.json(&format!("{} draft -o no.ply", EMBED.replace("--force ", "")), MISSED);
    assert_eq!((&missed["written"], missed["output"].is_null()), (&false.into(), true));
    let reason = missed["target_missed"][0].as_str().unwrap();
    assert!(
        !reason.contains("target missed") && reason.contains("below"),
        "{missed}"
    );
    assert!(!service.environment.path("no.ply").exists());

    service.server().signal("TERM");
    assert_eq!(service.server().wait().code(), Some(0));
    assert!(
        !service.log().contains("panicked") && !service.log().contains("ERROR"),
        "{}",
        service.log()
    );
}

/// With the shipped CLIP, on a real scene; a minute or two on two cores.
#[test]
fn a_real_scene_is_marked_as_without_a_server() {
    let Some(scene) = real_scene("playbot_31k.ply") else {
        return;
    };
    let environment = TestEnvironment::new();
    std::fs::copy(scene, environment.path("in.ply")).unwrap();
    environment.exits("key create --bits 32 --seed 1 -o k.key --device cpu", 0);
    let line = "--message 8f3a5c71 --preset draft --seed 5 --force";
    // Whether the mark is good is not the question here; it is the same.
    let expected = environment.run(&format!("embed in.ply expected.ply --key k.key {line} --device cpu"));
    let code = expected.status.code().unwrap();
    assert!(code == 0 || code == 3, "{}", String::from_utf8_lossy(&expected.stderr));

    let mut service = Service::start(environment, "--embedded-worker true");
    service.patience = Duration::from_secs(3600);
    service.json("key create --bits 32 --seed 1 --display-name site", 0);
    let marked = service.json(&format!("embed in.ply -o out.ply --key site {line}"), code);
    println!("{marked}");
    assert!(service.environment.read("out.ply") == service.environment.read("expected.ply"));
    service
        .environment
        .exits("render out.ply marked --views 5 --device cpu", 0);
    service
        .environment
        .exits("render in.ply unmarked --views 5 --device cpu", 0);
    for path in ["out.ply", "marked", "in.ply", "unmarked"] {
        let run = format!("verify {path} --key k.key --message 8f3a5c71 --device cpu");
        let code = service.environment.run(&run).status.code().unwrap();
        let verdict = verifies(&service, path, "8f3a5c71", code);
        println!("{path}: {verdict}");
        // What is marked matches, and what is not never does.
        let expected = if ["out.ply", "marked"].contains(&path) { 0 } else { 2 };
        assert_eq!(code, expected, "{path}: {verdict}");
    }
}
