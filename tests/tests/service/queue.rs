//! Cancelling, and giving back.
use std::time::{Duration, Instant};

use guardsplat_tests::{Service, TestEnvironment};

use crate::{EMBED, KEY, environment, offline};

/// With the shipped CLIP, whose steps take as long as they do.
#[test]
fn cancel_ends_a_running_embedding_soon() {
    let environment = TestEnvironment::new();
    environment.exits("sample in.ply --gaussians 5000 --seed 2", 0);
    let service = Service::start(environment, "--embedded-worker true");
    service.json("key create --bits 4 --seed 7 --display-name site", 0);
    let name = service.submit("embed in.ply --key site --message f");
    service.is_embedding(&name, 1);
    let asked = Instant::now();
    service.json(&format!("jobs cancel {name}"), 0);
    let job = service.reaches(&name, "cancelled");
    let took = asked.elapsed();
    println!("cancelled after {took:?}");
    assert!(took < Duration::from_secs(5), "{took:?}");
    assert!(job["result"].is_null() && job["failure"].is_null(), "{job}");
    // Whoever waits for it hears that too.
    let watched = service.json(&format!("jobs watch {name}"), 1);
    assert_eq!(watched["job"]["state"], "cancelled", "{watched}");
    // Nothing but the scene and the key is kept, and the worker goes on.
    service.keeps(2);
    let read = service.json("verify in.ply --key site --views 1", 2);
    assert_eq!(read["verdict"], "no_match");
}

#[test]
fn a_worker_that_is_asked_to_leave_gives_its_job_back() {
    let environment = environment();
    offline(&environment, "standard");
    let service = Service::start(environment, "");
    let mut first = service.worker("first");
    service.json(KEY, 0);
    let name = service.submit(&format!("{EMBED} standard"));
    service.is_embedding(&name, 1);
    first.signal("TERM");
    assert_eq!(first.wait().code(), Some(0));
    let job = service.job(&name);
    // At once, without waiting for the lease, and without an attempt less.
    assert_eq!((&job["state"], &job["attempt"]), (&"queued".into(), &0.into()), "{job}");
    let _second = service.worker("second");
    let job = service.reaches(&name, "succeeded");
    assert_eq!(job["attempt"], 1);
    service.keeps(4);
}
