//! Workers that die, that stop for a while, and jobs that kill their worker.
use std::fs;
use std::os::unix::fs::PermissionsExt;

use guardsplat_tests::process::until;
use guardsplat_tests::{Service, worker};

use crate::{EMBED, KEY, environment, offline};

/// Fetches what an embedding made and compares it with the offline result.
#[track_caller]
fn is_as_expected(service: &Service, job: &serde_json::Value) {
    let scene = job["result"]["scene"].as_str().unwrap_or_else(|| panic!("{job}"));
    service.json(&format!("artifact get {scene} -o out.ply"), 0);
    assert!(service.environment.read("out.ply") == service.environment.read("expected.ply"));
}

#[test]
fn when_a_worker_is_killed_another_finishes_its_job() {
    let environment = environment();
    offline(&environment, "standard");
    let service = Service::start(environment, "--lease-seconds 2");
    let mut first = service.worker("first");
    service.json(KEY, 0);
    let name = service.submit(&format!("{EMBED} standard"));
    service.is_embedding(&name, 1);
    first.kill();

    let _second = service.worker("second");
    let job = service.reaches(&name, "succeeded");
    assert_eq!(job["attempt"], 2);
    is_as_expected(&service, &job);
    // Scene, key, marked scene, comparison: nothing is left of the first attempt.
    service.keeps(4);
}

#[test]
fn a_worker_that_stopped_and_comes_back_changes_nothing() {
    let environment = environment();
    offline(&environment, "standard");
    let service = Service::start(environment, "--lease-seconds 2");
    let zombie = service.worker("zombie");
    service.json(KEY, 0);
    let name = service.submit(&format!("{EMBED} standard"));
    service.is_embedding(&name, 1);
    zombie.signal("STOP");

    let mut second = service.worker("second");
    service.is_embedding(&name, 2);
    // It comes back while the other is at work, and is told that the job is not its own any more.
    zombie.signal("CONT");
    until("the zombie notices", || {
        zombie.log().contains("the lease was lost").then_some(())
    });
    let job = service.reaches(&name, "succeeded");
    assert_eq!(job["attempt"], 2);
    is_as_expected(&service, &job);
    service.keeps(4);
    until("its success is logged", || {
        second.log().contains("job is done").then_some(())
    });
    // The key is all that the zombie made.
    assert_eq!(zombie.log().matches("job is done").count(), 1, "{}", zombie.log());

    // And it is as good as any worker again.
    second.kill();
    service.json("key create --bits 8 --seed 1", 0);
}

/// A worker that dies whenever it begins the job whose name is in the file `deadly`.
const FRAGILE: &str = r#"#!/bin/sh
log=worker-$$.log
: >"$log"
(
    while kill -0 $$; do
        if [ -s deadly ] && grep "job begins" "$log" | grep -qF "$(cat deadly)"; then kill -9 $$; fi
        sleep 0.05
    done
) >/dev/null 2>&1 &
exec "$WORKER" "$@" 2>>"$log"
"#;

#[test]
fn a_job_that_kills_its_worker_is_given_up_and_the_next_one_runs() {
    let mut environment = environment();
    environment.set("WORKER", worker());
    environment.write("fragile", FRAGILE);
    fs::set_permissions(environment.path("fragile"), fs::Permissions::from_mode(0o755)).unwrap();
    let flags = "--embedded-worker true --worker-binary fragile --lease-seconds 2";
    let service = Service::start(environment, flags);
    service.json(KEY, 0);

    // The worker finds no job, and then there are two: the deadly one is known before any of them begins.
    let scene = service.json("artifact put in.ply", 0);
    let scene = scene["name"].as_str().unwrap();
    let deadly = service.submit(&format!("embed {scene} --key site --message c0ffee42 --preset paper"));
    service
        .environment
        .write("deadly", deadly.strip_prefix("jobs/").unwrap());
    let next = service.submit("key create --bits 8 --seed 1");
    let failed = service.reaches(&deadly, "failed");
    assert_eq!((&failed["attempt"], &failed["max_attempts"]), (&3.into(), &3.into()));
    assert_eq!(failed["failure"]["reason"], "attempts_exhausted", "{failed}");
    let message = failed["failure"]["message"].as_str().unwrap();
    assert!(message.contains("was lost"), "{message}");
    // It did not wait for the end of the other.
    assert_eq!(service.reaches(&next, "succeeded")["attempt"], 1);
    service.json("key create --bits 8 --seed 2", 0);
}
