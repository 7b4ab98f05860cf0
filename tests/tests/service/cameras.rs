//! A room is marked for who stands in it, through the service as without it.
use guardsplat_tests::Service;

use crate::{KEY, MISSED, environment};

const FIGURES: [&str; 4] = ["steps", "psnr_db", "bit_accuracy", "target_missed"];
const MARK: &str = "--message c0ffee42 --seed 5 --size 64 --force --preset draft";

#[test]
fn a_room_is_marked_where_its_viewers_stand() {
    let environment = environment();
    environment.exits(
        "sample room.ply --kind room --cameras cameras.json --gaussians 3000 --sh-degree 1 --seed 2",
        0,
    );
    environment.exits("key create --bits 32 --seed 7 -o k.key --device cpu", 0);
    let offline = |more: &str, out: &str| {
        environment.json(
            &format!("embed room.ply {out} --key k.key {MARK} --device cpu --json {more}"),
            MISSED,
        )
    };
    let expected = offline("--cameras cameras.json", "expected.ply");
    offline("", "outside.ply");
    assert!(environment.read("expected.ply") != environment.read("outside.ply"));
    let verify = "verify expected.ply --message c0ffee42 --cameras cameras.json --views 5";
    let read_offline = environment.run(&format!("{verify} --key k.key --device cpu --json"));

    let service = Service::start(environment, "--embedded-worker true");
    service.json(KEY, 0);
    let marked = service.json(
        &format!("embed room.ply --key site {MARK} --cameras cameras.json -o out.ply"),
        MISSED,
    );
    for field in FIGURES {
        assert_eq!(marked[field], expected[field], "{field}");
    }
    assert!(service.environment.read("out.ply") == service.environment.read("expected.ply"));
    let read = service.client(&format!("--json {verify} --key site"));
    let said = |output: &std::process::Output| -> serde_json::Value { serde_json::from_slice(&output.stdout).unwrap() };
    for field in ["verdict", "matched_bits", "p_value", "bit_accuracy", "views"] {
        assert_eq!(said(&read)[field], said(&read_offline)[field], "{field}");
    }

    // What is wrong with cameras is told by their name, and is no worker's fault.
    service.environment.write("cameras.json", b"[{\"width\": 10}]");
    let line = format!("embed room.ply --key site {MARK} --cameras cameras.json -o no.ply");
    let error = &service.json(&line, 1)["error"];
    assert_eq!(error["reason"], "invalid_input", "{error}");
    let told = error["message"].as_str().unwrap();
    assert!(
        told.contains("cameras.json (artifacts/") && told.contains("camera 0"),
        "{told}"
    );
    assert!(!service.environment.path("no.ply").exists());
}
