//! A server that speaks TLS and asks for tokens: a project has its scenes marked by a worker that comes in from outside,
//! and strangers get nowhere.
use guardsplat_tests::{Service, TestEnvironment, program};
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};

use crate::{EMBED, KEY, MISSED, environment, offline};

/// Writes a CA, and a certificate that it made out to `localhost`.
fn certify(environment: &TestEnvironment) {
    let mut params = CertificateParams::new(Vec::new()).unwrap();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let issuer = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
    let key = KeyPair::generate().unwrap();
    let params = CertificateParams::new(["localhost".to_owned()]).unwrap();
    let certificate = params.signed_by(&key, &issuer).unwrap();
    environment.write("ca.pem", issuer.pem());
    environment.write("server.pem", certificate.pem());
    environment.write("server.key", key.serialize_pem());
}

/// A token, made on the server's machine.
fn token(environment: &TestEnvironment, project: &str, scopes: &[&str]) -> String {
    let mut command = environment.command(&program("guardsplat-server"));
    command.args(["--data-dir", "data", "token", "create", "--project", project]);
    scopes.iter().for_each(|scope| {
        command.args(["--scope", scope]);
    });
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}

/// What programs are given to come in with.
fn pass(environment: &TestEnvironment, token: &str) -> Vec<(String, String)> {
    let ca = environment.path("ca.pem").to_str().unwrap().to_owned();
    vec![("GUARDSPLAT_CA".into(), ca), ("GUARDSPLAT_TOKEN".into(), token.into())]
}

#[test]
fn a_project_does_its_work_over_tls_and_strangers_do_not() {
    let environment = environment();
    certify(&environment);
    offline(&environment, "draft");
    let [studio, rival, worker] = [
        ("studio", &["embed", "verify"][..]),
        ("rival", &["embed", "verify"]),
        ("operator", &["worker"]),
    ]
    .map(|(project, scopes)| token(&environment, project, scopes));
    let flags = "--access tokens --tls-certificate server.pem --tls-key server.key";
    let mut service = Service::start(environment, flags);
    let pass = |token: &str, service: &Service| pass(&service.environment, token);
    let code = |service: &Service, line: &str| service.json(line, 1)["error"]["code"].clone();

    // Without a token, with one of nobody's, with one that is for other things.
    service.client_variables = pass(&studio.replace(&studio[50..], "nobody"), &service);
    assert_eq!(code(&service, "jobs list"), "UNAUTHENTICATED");
    service.client_variables.truncate(1);
    assert_eq!(code(&service, "jobs list"), "UNAUTHENTICATED");
    service.client_variables = pass(&worker, &service);
    assert_eq!(code(&service, "jobs list"), "PERMISSION_DENIED");

    // A worker with the token of a project ends by itself, one with its own does the work.
    service.worker_variables = pass(&studio, &service);
    let status = service.worker("intruder").wait();
    assert!(!status.success(), "a project's token leased a job");
    service.worker_variables = pass(&worker, &service);
    let mut workhorse = service.worker("workhorse");
    service.client_variables = pass(&studio, &service);
    service.json(KEY, 0);
    let marked = service.json(&format!("{EMBED} draft -o out.ply"), MISSED);
    assert!(service.environment.read("out.ply") == service.environment.read("expected.ply"));
    let job = marked["job"].as_str().unwrap().to_owned();

    // Another project sees nothing of it.
    service.client_variables = pass(&rival, &service);
    assert_eq!(code(&service, &format!("jobs get {job}")), "NOT_FOUND");
    assert_eq!(service.json("jobs list", 0)["jobs"], serde_json::json!([]));
    let told = service.json("verify out.ply --key site", 1)["error"]["message"].to_string();
    assert!(told.contains("site"), "{told}");

    // Without a CA the certificate is nobody's.
    service.client_variables.remove(0);
    service.json("jobs list --timeout 2", 1);
    workhorse.kill();
    for secret in [studio, rival, worker] {
        // Its id may be told, what follows it not.
        let secret = secret.rsplit('_').next().unwrap();
        for log in ["server.log", "workhorse.log", "intruder.log"] {
            assert!(
                !String::from_utf8_lossy(&service.environment.read(log)).contains(secret),
                "{log}"
            );
        }
    }
}
