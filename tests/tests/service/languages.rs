//! Other languages need nothing of ours: a Python client that knows only what the server says about itself.
use std::process::Command;

use guardsplat_tests::{Service, python};

use crate::environment;

#[test]
fn a_client_of_another_language_works_from_reflection_alone() {
    let Some(python) = python::python("grpc") else {
        return;
    };
    let service = Service::start(environment(), "--embedded-worker true");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/service/generic_client.py");
    let output = Command::new(python).args([script, service.address()]).output().unwrap();
    let [text, log] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    assert!(output.status.success(), "{text}{log}\n{}", service.log());
    // The script says at its end that it got there.
    assert!(text.ends_with("done\n"), "{text}");
    assert_eq!(service.json("key list", 0)["keys"][0]["display_name"], "from afar");
}
