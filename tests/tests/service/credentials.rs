//! Content credentials by jobs of the service: signed by the worker, found again by the mark, resolved over HTTP, and gone
//! when they are deleted. With the shipped CLIP where the mark has to be read.
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use guardsplat_tests::{Process, Service, TestEnvironment, program, worker};
use serde_json::Value;

use crate::{EMBED, KEY, environment};

/// Set where a missing program is a failure: by deploy/credentials.sh, which builds it.
const WANTED: &str = "GUARDSPLAT_CREDENTIALS_BUILT";

/// Whether guardsplat-credentials is there; without it a test is skipped with a message.
fn is_built() -> bool {
    let there = worker().with_file_name("guardsplat-credentials").is_file();
    assert!(
        there || std::env::var_os(WANTED).is_none(),
        "guardsplat-credentials is not built"
    );
    if !there {
        eprintln!("skipped: guardsplat-credentials is not built; deploy/credentials.sh builds it and runs this test");
    }
    there
}

/// A token, made on the server's machine.
fn token(environment: &TestEnvironment, project: &str) -> String {
    let mut command = environment.command(&program("guardsplat-server"));
    command.args(["--data-dir", "data", "token", "create", "--project", project]);
    command.args(["--scope", "embed", "--scope", "verify", "--scope", "admin"]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// Where the server says that its page is.
fn page(service: &Service) -> String {
    let log = service.log();
    let (_, rest) = log.split_once("the page is at http://").expect("the log says where");
    rest.split('/').next().unwrap().to_owned()
}

/// Status and body of a question to the resolution API, in one piece as HTTP/1.0 has it.
fn ask(address: &str, target: &str, token: Option<&str>) -> (u16, Vec<u8>) {
    let mut stream = TcpStream::connect(address).unwrap();
    let shown = token
        .map(|token| format!("Authorization: Bearer {token}\r\n"))
        .unwrap_or_default();
    write!(stream, "GET {target} HTTP/1.0\r\nHost: h\r\n{shown}\r\n").unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let end = answer.windows(4).position(|part| part == b"\r\n\r\n").unwrap();
    let status = std::str::from_utf8(&answer[9..12]).unwrap().parse().unwrap();
    (status, answer[end + 4..].to_vec())
}

/// Manifests that an answer names.
fn named((status, body): (u16, Vec<u8>)) -> Value {
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&body));
    serde_json::from_slice::<Value>(&body).unwrap()["matches"].clone()
}

#[test]
fn a_stripped_copy_finds_its_credentials_by_the_mark_alone() {
    if !is_built() {
        return;
    }
    let environment = TestEnvironment::new();
    environment.exits("sample in.ply --gaussians 3000 --sh-degree 1 --seed 2", 0);
    environment.exits("sample other.ply --gaussians 3000 --sh-degree 1 --seed 3", 0);
    let [own, stranger] = ["studio", "rival"].map(|project| token(&environment, project));
    let flags = "--embedded-worker true --access tokens --page-listen 127.0.0.1:0";
    let mut service = Service::start(environment, flags);
    service.patience = Duration::from_secs(600);
    service.client_variables = vec![("GUARDSPLAT_TOKEN".into(), own.clone())];
    service.json("key create --bits 64 --seed 3 --display-name site", 0);
    service.json("owner create studio", 0);
    let register = |file: &str| {
        let told = service.json(&format!("asset create {file} --owner studio --key site"), 0);
        told["name"].as_str().unwrap().to_owned()
    };
    let (asset, plain) = (register("in.ply"), register("other.ply"));
    let embed = |from: &str, to: &str, asset: &str, more: &str| {
        let line = format!("--json embed {from} -o {to} --key site --asset {asset} --preset draft --seed 5 --size 64");
        // Whether the mark is good enough for the preset is not the question here: it is read.
        let output = service.client(&format!("{line} --force {more}"));
        let text = String::from_utf8_lossy(&output.stderr);
        assert!(matches!(output.status.code(), Some(0 | 3)), "{text}");
        serde_json::from_slice::<Value>(&output.stdout).unwrap()
    };
    let marked = embed("in.ply", "out.ply", &asset, "--credentials out.c2pa");
    let made = &marked["credentials"];
    assert_eq!(
        (&made["test_certificate"], &made["job"]),
        (&true.into(), &marked["job"])
    );
    assert_eq!(marked["credentials_file"], "out.c2pa");
    let without = embed("other.ply", "plain.ply", &plain, "");
    assert!(without["credentials"].is_null(), "{without}");

    // The statement is about this file, by a test certificate, and names the original as its owner does.
    let told = service.environment.json("credentials check out.ply out.c2pa --json", 3);
    assert_eq!(
        (&told["verdict"], &told["test_certificate"]),
        (&"untrusted".into(), &true.into())
    );
    assert_eq!(
        (&told["manifest"], &told["original_title"]),
        (&made["manifest"], &"in.ply".into())
    );
    service.environment.exits("credentials check in.ply out.c2pa", 2);

    // A copy in another format has no statement and no hash that fits.
    service.environment.exits("convert out.ply copy.splat", 0);
    let verify = |path: &str, more: &str, code| {
        let line = format!("verify {path} --key site --size 64 --search --credentials {more}");
        service.json(&line, code)
    };
    let found = verify("copy.splat", "found.c2pa", 0);
    assert_eq!(
        (&found["asset"], &found["credentials"][0]),
        (&asset.clone().into(), made)
    );
    assert_eq!(found["credentials_file"], "found.c2pa");
    assert!(service.environment.read("found.c2pa") == service.environment.read("out.c2pa"));
    // A mark without any, and no mark: nothing is written, and it is said why.
    let found = verify("plain.ply", "none.c2pa", 0);
    assert_eq!(
        (&found["asset"], found["credentials"].as_array().map(Vec::len)),
        (&plain.into(), Some(0))
    );
    let said = service.client("verify plain.ply --key site --size 64 --search --credentials none.c2pa");
    let said = String::from_utf8_lossy(&said.stderr).into_owned();
    assert!(said.contains("was made without any"), "{said}");
    verify("in.ply", "none.c2pa", 2);
    assert!(!service.environment.path("none.c2pa").exists());

    // Over HTTP, for those of the project.
    let address = page(&service);
    let value = made["soft_binding"].as_str().unwrap();
    let encoded = value.replace('+', "%2B").replace('/', "%2F").replace('=', "%3D");
    let by_binding = format!("/matches/byBinding?alg=org.guardsplat.sh.1&value={encoded}");
    let manifest = made["manifest"].as_str().unwrap();
    let sidecar = format!("/manifests/{manifest}");
    let (status, body) = ask(&address, "/services/supportedAlgorithms", None);
    assert!(status == 200 && body.windows(19).any(|part| part == b"org.guardsplat.sh.1"));
    assert_eq!(
        named(ask(&address, &by_binding, Some(&own))),
        serde_json::json!([{ "manifestId": manifest }])
    );
    let (status, body) = ask(&address, &sidecar, Some(&own));
    assert!(status == 200 && body == service.environment.read("out.c2pa"));
    assert_eq!(
        named(ask(&address, &by_binding, Some(&stranger))),
        serde_json::json!([])
    );
    assert_eq!(ask(&address, &sidecar, Some(&stranger)).0, 404);
    for target in [&by_binding, &sidecar] {
        assert_eq!(ask(&address, target, None).0, 401);
    }

    // Deleted, it is found by nobody.
    service.json(&format!("artifact delete {}", made["artifact"].as_str().unwrap()), 0);
    assert_eq!(named(ask(&address, &by_binding, Some(&own))), serde_json::json!([]));
    assert_eq!(ask(&address, &sidecar, Some(&own)).0, 404);
    let found = verify("copy.splat", "gone.c2pa", 0);
    assert_eq!(
        (&found["asset"], found["credentials"].as_array().map(Vec::len)),
        (&asset.into(), Some(0))
    );
    let log = service.log();
    assert!(!log.contains("ERROR") && !log.contains("panicked"), "{log}");
}

/// A worker in a folder of its own, where nothing is beside it.
fn lonely_worker(service: &Service) -> Process {
    let environment = &service.environment;
    let alone = environment.path("alone/guardsplat-worker");
    std::fs::create_dir(environment.path("alone")).unwrap();
    let link = |from: &Path, to: &Path| std::fs::hard_link(from, to).or_else(|_| std::fs::copy(from, to).map(|_| ()));
    link(&worker(), &alone).unwrap();
    let mut command = environment.command(&alone);
    command.args(["run", "--device", "cpu", "--name", "lonely", "--server", &service.url()]);
    command.env("PATH", environment.path("alone")).stdout(Stdio::null());
    Process::start(&mut command, &environment.path("lonely.log"))
}

#[test]
fn a_worker_without_the_program_says_what_to_install() {
    let service = Service::start(environment(), "");
    let _worker = lonely_worker(&service);
    service.json(KEY, 0);
    let told = service.json(&format!("{EMBED} draft -o out.ply --credentials out.c2pa"), 1);
    let error = &told["error"];
    let message = error["message"].as_str().unwrap();
    assert!(
        message.contains("guardsplat-credentials can't be run") && message.contains("docs/credentials.md"),
        "{told}"
    );
    let job = service.job(error["job"].as_str().unwrap());
    assert_eq!((&job["state"], &job["attempt"]), (&"failed".into(), &1.into()));
    for file in ["out.ply", "out.c2pa"] {
        assert!(!service.environment.path(file).exists(), "{file}");
    }
}
