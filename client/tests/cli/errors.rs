//! What goes wrong before or without a job, settings, and the exit code 1.
use std::net::TcpListener;

use super::run::{TestEnvironment, finish};

#[test]
fn no_server_is_told_at_once_with_what_to_do() {
    let environment = TestEnvironment::new();
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let ran = finish(
        environment
            .command(&format!("key list --json --server http://{free}"))
            .spawn()
            .unwrap(),
    );
    assert_eq!(ran.code, 1);
    assert!(
        ran.err.contains(&format!("no server answers at http://{free}")),
        "{}",
        ran.err
    );
    assert!(
        ran.err.contains("guardsplat-server") && ran.err.contains("--server"),
        "{}",
        ran.err
    );
    assert_eq!(ran.json()["error"]["reason"], "no_server");
}

#[test]
fn a_server_that_says_nothing_is_not_waited_for_forever() {
    let environment = TestEnvironment::new();
    // It takes the connection, and never says a word.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", silent.local_addr().unwrap());
    let ran = finish(
        environment
            .command(&format!("key list --timeout 1 --server {url}"))
            .spawn()
            .unwrap(),
    );
    assert_eq!(ran.code, 1, "{}", ran.err);
    let told = "error: listing keys failed: the server was silent for 1 s (DEADLINE_EXCEEDED)\n";
    assert_eq!(ran.err, told);
}

#[test]
fn wrong_usage_exits_with_1_and_help_with_0() {
    let environment = TestEnvironment::new();
    for line in [
        "embed",
        "verify --key K",
        "nonsense",
        "key create --bits 199",
        "jobs get 7",
        "",
    ] {
        assert_eq!(environment.run(line).code, 1, "{line}");
    }
    for line in ["--help", "--version", "embed --help"] {
        assert_eq!(environment.run(line).code, 0, "{line}");
    }
}

#[test]
fn what_is_not_there_is_told_with_details() {
    let environment = TestEnvironment::new();
    let id = "00000000-0000-7000-8000-000000000001";
    let ran = environment.run(&format!("jobs get {id} --json"));
    assert_eq!(ran.code, 1);
    let error = &ran.json()["error"];
    assert_eq!(
        (&error["code"], &error["reason"]),
        (&"NOT_FOUND".into(), &"NOT_FOUND".into())
    );
    assert_eq!(error["resource"], format!("jobs/{id}"));
    let expected = format!("error: reading the job failed: jobs/{id} does not exist (NOT_FOUND)\n");
    assert_eq!(ran.err, expected);
    assert_eq!(environment.run(&format!("artifact get {id} -o out")).code, 1);
    assert!(!environment.path("out").exists());
}

#[test]
fn the_server_may_be_named_in_a_file() {
    let environment = TestEnvironment::new();
    let text = format!("server = \"{}\"\n", environment.fake.url());
    std::fs::create_dir_all(environment.path("config/guardsplat")).unwrap();
    environment.file("config/guardsplat/client.toml", text.as_bytes());
    let ran = finish(environment.command("key list").spawn().unwrap());
    assert_eq!(ran.code, 0, "{}", ran.err);
    environment.file("config/guardsplat/client.toml", b"sever = 1");
    let ran = finish(environment.command("key list").spawn().unwrap());
    assert_eq!(ran.code, 1);
    assert!(
        ran.err.contains("client.toml") && ran.err.contains("sever"),
        "{}",
        ran.err
    );
}

#[test]
fn shells_get_their_completions_without_a_server() {
    let environment = TestEnvironment::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let ran = finish(environment.command(&format!("completions {shell}")).spawn().unwrap());
        assert_eq!(ran.code, 0, "{}", ran.err);
        assert!(ran.out.contains("guardsplat") && ran.out.contains("embed"), "{shell}");
    }
}
