//! What is in `deploy/` to be run with: nothing of it can be run here, so that it is parsed, and compared with what the
//! programs really are: their settings, their metrics, their ports.
mod queries;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use guardsplat_server::run::Readiness;
use guardsplat_server::settings::{Flags, Settings, load};
use serde_json::Value;

/// Where the server listens in containers, for calls and for metrics.
const PORTS: [&str; 2] = ["50051", "9464"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn read(path: &str) -> String {
    let path = root().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// All documents of a YAML file.
fn yaml(path: &str) -> Vec<Value> {
    let documents = serde_saphyr::from_multiple::<Value>(&read(path));
    documents.unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// All objects for Kubernetes.
fn objects() -> Vec<Value> {
    let names = ["server", "worker", "scaling", "network"];
    let files = names.map(|name| yaml(&format!("deploy/kubernetes/{name}.yaml")));
    files.into_iter().flatten().collect()
}

fn object(kind: &str, name: &str) -> Value {
    let found = objects()
        .into_iter()
        .find(|object| object["kind"] == kind && object["metadata"]["name"] == name);
    found.unwrap_or_else(|| panic!("there is no {kind} {name}"))
}

fn container(deployment: &str) -> Value {
    object("Deployment", deployment)["spec"]["template"]["spec"]["containers"][0].clone()
}

/// Text values of a map, as the environment of a program.
fn variables(map: &Value) -> BTreeMap<String, String> {
    let map = map.as_object().unwrap_or_else(|| panic!("{map} is no map"));
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    map.iter().map(|(name, value)| (name.clone(), text(value))).collect()
}

/// What `ENV` sets in a Dockerfile.
fn image(path: &str) -> BTreeMap<String, String> {
    let joined = read(path).replace("\\\n", " ");
    let lines = joined.lines().filter_map(|line| line.strip_prefix("ENV "));
    let pairs = lines.flat_map(str::split_whitespace).map(|pair| {
        let (name, value) = pair.split_once('=').unwrap();
        (name.to_owned(), value.to_owned())
    });
    pairs.collect()
}

/// What `Environment=` sets in a unit.
fn unit(path: &str) -> BTreeMap<String, String> {
    let text = read(path);
    let pairs = text.lines().filter_map(|line| line.strip_prefix("Environment="));
    pairs
        .map(|pair| pair.split_once('=').unwrap())
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .collect()
}

/// What the server makes of an environment.
fn settings(variables: BTreeMap<String, String>) -> Settings {
    let empty = tempfile::NamedTempFile::new().unwrap();
    let flags = Flags {
        config: Some(empty.path().to_owned()),
        ..Flags::default()
    };
    load(flags, variables.clone()).unwrap_or_else(|error| panic!("{error}, of {variables:?}"))
}

fn listens_on_its_ports(settings: &Settings) {
    let metrics = settings.metrics_listen.unwrap();
    let ports = [settings.listen.port(), metrics.port()].map(|port| port.to_string());
    assert_eq!(ports, PORTS);
    assert!(!settings.embedded_worker, "a worker of its own");
}

#[test]
fn the_server_takes_the_settings_it_is_given_everywhere() {
    let of_image = image("deploy/container/server.Dockerfile");
    let compose = &yaml("deploy/compose.yaml")[0]["services"]["guardsplat-server"]["environment"];
    let pod = object("ConfigMap", "guardsplat-server")["data"].clone();
    for (given, database) in [(compose, None), (&pod, Some("postgres://db/guardsplat"))] {
        let mut all = of_image.clone();
        all.extend(variables(given));
        // From a Secret.
        all.extend(database.map(|url| ("GUARDSPLAT_DATABASE".to_owned(), url.to_owned())));
        let settings = settings(all);
        listens_on_its_ports(&settings);
        assert!(settings.database.is_some() && settings.master_key_file.is_some());
    }
    listens_on_its_ports(&settings(unit("deploy/systemd/guardsplat-server.service")));
    // The image alone is open to nobody by oversight.
    let empty = tempfile::NamedTempFile::new().unwrap();
    let flags = Flags {
        config: Some(empty.path().to_owned()),
        ..Flags::default()
    };
    assert!(load(flags, of_image).is_err());
    // What comes from a Secret is named as the server has it.
    let names: Vec<String> = container("guardsplat-server")["env"]
        .as_array()
        .unwrap()
        .iter()
        .map(|variable| variable["name"].as_str().unwrap().to_owned())
        .collect();
    assert_eq!(
        names,
        ["GUARDSPLAT_DATABASE", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"]
    );
}

/// The worker's sources tell what it takes.
#[test]
fn the_worker_takes_what_it_is_given_everywhere() {
    let sources = [
        "worker/src/cli/run.rs",
        "crates/engine/src/models/mod.rs",
        "proto/src/connect.rs",
    ]
    .map(read);
    let run = &sources[0];
    let compose = &yaml("deploy/compose.yaml")[0]["services"]["worker"];
    let pod = container("guardsplat-worker");
    let mut names: Vec<String> = image("deploy/container/worker.Dockerfile").into_keys().collect();
    names.extend(unit("deploy/systemd/guardsplat-worker.service").into_keys());
    names.extend(variables(&compose["environment"]).into_keys());
    names.extend(
        pod["env"]
            .as_array()
            .unwrap()
            .iter()
            .map(|v| v["name"].as_str().unwrap().to_owned()),
    );
    let ours: Vec<_> = names.iter().filter(|name| name.starts_with("GUARDSPLAT_")).collect();
    assert!(ours.len() >= 4, "{names:?}");
    for name in ours {
        assert!(sources.iter().any(|source| source.contains(name.as_str())), "{name}");
    }
    let unit = read("deploy/systemd/guardsplat-worker.service");
    let start = unit.lines().find(|line| line.starts_with("ExecStart=")).unwrap();
    let words = |list: &Value| -> Vec<String> {
        let words = list
            .as_array()
            .unwrap()
            .iter()
            .map(|word| word.as_str().unwrap().to_owned());
        words.collect()
    };
    let lines = [
        words(&compose["command"]),
        words(&pod["args"]),
        start.split(' ').skip(1).map(str::to_owned).collect(),
    ];
    for line in lines {
        assert_eq!(line[0], "run");
        assert!(line.contains(&"--server".to_owned()), "{line:?}");
        for flag in line.iter().filter_map(|word| word.strip_prefix("--")) {
            let field = format!("    {}: ", flag.replace('-', "_"));
            assert!(run.contains(&field), "--{flag} is no flag of the worker");
        }
        for url in line.iter().filter(|word| word.starts_with("http")) {
            assert!(url.ends_with(PORTS[0]), "{url}");
        }
    }
}

#[test]
fn images_and_ports_agree() {
    let compose = &yaml("deploy/compose.yaml")[0];
    let services = &compose["services"];
    let kustomization = &yaml("deploy/kubernetes/kustomization.yaml")[0];
    let images: Vec<&str> = kustomization["images"]
        .as_array()
        .unwrap()
        .iter()
        .map(|image| image["name"].as_str().unwrap())
        .collect();
    for (service, deployment) in [
        ("guardsplat-server", "guardsplat-server"),
        ("worker", "guardsplat-worker"),
    ] {
        let image = container(deployment)["image"].clone();
        assert_eq!(services[service]["image"], image);
        assert!(images.contains(&image.as_str().unwrap()), "{image}");
        let dockerfile = services[service]["build"]["dockerfile"].as_str().unwrap();
        assert!(
            read(dockerfile).contains(&format!("ENTRYPOINT [{image}]")),
            "{dockerfile}"
        );
        assert!(read(dockerfile).contains("\nUSER 10001\n"), "{dockerfile} runs as root");
        let pod = &object("Deployment", deployment)["spec"]["template"]["spec"];
        assert_eq!(pod["securityContext"]["runAsUser"], 10001);
        let version = format!("FROM rust:{}-bookworm AS build", env!("CARGO_PKG_RUST_VERSION"));
        assert!(read(dockerfile).contains(&version), "{dockerfile} has another Rust");
    }
    for resource in kustomization["resources"].as_array().unwrap() {
        read(&format!("deploy/kubernetes/{}", resource.as_str().unwrap()));
    }
    let expose = format!("EXPOSE {} {}", PORTS[0], PORTS[1]);
    assert!(read("deploy/container/server.Dockerfile").contains(&expose));
    let published: Vec<String> = PORTS.map(|port| format!("127.0.0.1:{port}:{port}")).into();
    assert_eq!(services["guardsplat-server"]["ports"], serde_json::json!(published));
    let ports: Vec<String> = container("guardsplat-server")["ports"]
        .as_array()
        .unwrap()
        .iter()
        .map(|port| port["containerPort"].to_string())
        .collect();
    assert_eq!(ports, PORTS);
    let service = object("Service", "guardsplat-server");
    assert_eq!(service["spec"]["ports"][0]["port"].to_string(), PORTS[0]);
    let scraped = &yaml("deploy/monitoring/prometheus.yaml")[0]["scrape_configs"][0]["static_configs"][0]["targets"][0];
    assert_eq!(scraped.as_str().unwrap(), format!("guardsplat-server:{}", PORTS[1]));
    // Every secret that a service names is one.
    let secrets = compose["secrets"].as_object().unwrap();
    for (name, service) in services.as_object().unwrap() {
        for secret in service["secrets"].as_array().into_iter().flatten() {
            assert!(secrets.contains_key(secret.as_str().unwrap()), "{name}: {secret}");
        }
    }
}

#[test]
fn probes_ask_for_what_there_is() {
    let parts = Readiness::default().parts().map(|(part, _)| part);
    let pod = container("guardsplat-server");
    let health = services_health();
    let mut asked: Vec<String> = ["startupProbe", "livenessProbe", "readinessProbe"]
        .map(|probe| pod[probe]["httpGet"]["path"].as_str().unwrap().to_owned())
        .into();
    asked.extend(
        health
            .split_whitespace()
            .filter(|word| word.starts_with('/'))
            .map(str::to_owned),
    );
    let mut excluded = 0;
    for path in asked {
        let (path, query) = path.split_once('?').unwrap_or((&path, ""));
        assert!(
            ["/livez", "/readyz"].contains(&path) || path.starts_with("/dev/tcp/"),
            "{path}"
        );
        if let Some(part) = query.strip_prefix("exclude=") {
            assert!(parts.contains(&part), "{part}");
            excluded += 1;
        }
    }
    assert_eq!(excluded, 2);
    assert!(health.contains(&format!("/dev/tcp/127.0.0.1/{}", PORTS[1])), "{health}");
    for probe in ["startupProbe", "livenessProbe", "readinessProbe"] {
        assert_eq!(pod[probe]["httpGet"]["port"], "metrics");
    }
}

fn services_health() -> String {
    let compose = &yaml("deploy/compose.yaml")[0];
    let test = &compose["services"]["guardsplat-server"]["healthcheck"]["test"];
    test[3].as_str().unwrap().replace("3<>", "")
}

/// With systemd's own eyes, where there is one.
#[test]
fn units_are_sound() {
    let folder = tempfile::TempDir::new().unwrap();
    let mut paths = Vec::new();
    for name in ["guardsplat-server.service", "guardsplat-worker.service"] {
        let text = read(&format!("deploy/systemd/{name}"));
        assert!(text.contains("\nNoNewPrivileges=yes\n") && text.contains("\nProtectSystem=strict\n"));
        assert!(text.contains("\nUser=guardsplat\n"), "{name}");
        // The programs are not installed here.
        let text = text
            .replace("ExecStart=guardsplat-server", "ExecStart=/bin/true")
            .replace("ExecStart=guardsplat-worker", "ExecStart=/bin/true");
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        paths.push(path);
    }
    let verified = Command::new("systemd-analyze").arg("verify").args(paths).output();
    let Ok(output) = verified else {
        assert!(std::env::var_os("CI").is_none(), "there is no systemd-analyze");
        eprintln!("skipped: there is no systemd-analyze");
        return;
    };
    let text = String::from_utf8_lossy(&output.stderr);
    let ours: Vec<&str> = text.lines().filter(|line| line.contains("guardsplat")).collect();
    assert!(output.status.success() && ours.is_empty(), "{text}");
}

/// What packages take from the repository is there; the rest is built by deploy/package.sh.
#[test]
fn what_goes_into_packages_is_there() {
    for (folder, fewest) in [("client", 2), ("server", 5), ("worker", 4)] {
        let text = read(&format!("{folder}/Cargo.toml"));
        let sources = text
            .lines()
            .filter_map(|line| line.trim().strip_prefix("[\"../")?.split('"').next());
        let kept: Vec<&str> = sources.filter(|source| !source.starts_with("target/")).collect();
        assert!(kept.len() >= fewest, "{folder}: {kept:?}");
        for source in kept {
            assert!(root().join(source).is_file(), "{folder}: {source}");
        }
    }
}
