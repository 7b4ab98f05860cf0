//! The service as its users have it: the real server, workers and client, as processes. Most tests use a tiny CLIP with
//! random weights, with which a mark is hardly read, but made and read as with any other.
mod bad_input;
mod cameras;
mod claims;
mod crashes;
mod credentials;
mod languages;
mod main_job;
mod memory;
mod queue;
mod restarts;
mod strangers;

use guardsplat_engine::testing::tiny;
use guardsplat_tests::TestEnvironment;
use serde_json::Value;

/// Marks like the embed jobs of these tests, offline.
const OFFLINE: &str = "embed in.ply expected.ply --key k.key --message c0ffee42 --seed 5 --size 64 --device cpu --force \
    --report report --json --preset";
/// The same through the service.
const EMBED: &str = "embed in.ply --key site --message c0ffee42 --seed 5 --size 64 --force --preset";
/// A key as in `k.key`.
const KEY: &str = "key create --bits 32 --seed 7 --display-name site";
/// `embed --force` with the tiny CLIP, which sees too little for any target.
const MISSED: i32 = 3;

/// A folder with a tiny CLIP, and a scene.
fn environment() -> TestEnvironment {
    let mut environment = TestEnvironment::new();
    tiny::write(&environment.path("clip"));
    environment.set("GUARDSPLAT_CLIP", environment.path("clip"));
    environment.exits("sample in.ply --gaussians 500 --sh-degree 1 --seed 2", 0);
    environment
}

/// What the worker makes of the scene without a server: a key, and the marked scene `expected.ply`, whose figures come
/// back.
fn offline(environment: &TestEnvironment, preset: &str) -> Value {
    environment.exits("key create --bits 32 --seed 7 -o k.key --device cpu", 0);
    environment.json(&format!("{OFFLINE} {preset}"), MISSED)
}
