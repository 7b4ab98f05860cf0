//! Layers in their order, limits, and the file of defaults.
use std::fs;
use std::path::Path;

use clap::{CommandFactory, Parser};
use tempfile::NamedTempFile;

use super::*;

const SECRET: &str = "5ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2";

/// Loads a file, variables and flags.
fn layers(file: &str, variables: &[(&str, &str)], flags: &[&str]) -> Result<Settings, SettingsError> {
    let path = NamedTempFile::with_suffix(".toml").unwrap();
    fs::write(&path, file).unwrap();
    let config = path.path().to_str().unwrap();
    let arguments = Arguments::try_parse_from(["guardsplat-server", "--config", config].iter().chain(flags)).unwrap();
    load(
        arguments.flags,
        variables
            .iter()
            .map(|(name, value)| (name.to_string(), value.to_string())),
    )
}

fn error(file: &str, variables: &[(&str, &str)], flags: &[&str]) -> String {
    layers(file, variables, flags).unwrap_err().to_string()
}

#[test]
fn each_layer_overrides_the_one_before() {
    let default = layers("", &[], &[]).unwrap();
    assert_eq!(default.lease_seconds, 30);
    let file = "lease_seconds = 31\nmax_attempts = 4\nembedded_worker = false\nworker_device = \"cpu\"";
    let settings = layers(file, &[], &[]).unwrap();
    assert_eq!(
        (settings.lease_seconds, settings.max_attempts, settings.embedded_worker),
        (31, 4, false)
    );
    assert_eq!(settings.worker_device, WorkerDevice::Cpu);
    let variables = [
        ("GUARDSPLAT_LEASE_SECONDS", "32"),
        ("GUARDSPLAT_EMBEDDED_WORKER", "true"),
    ];
    let settings = layers(file, &variables, &[]).unwrap();
    assert_eq!(
        (settings.lease_seconds, settings.max_attempts, settings.embedded_worker),
        (32, 4, true)
    );
    let settings = layers(
        file,
        &variables,
        &["--lease-seconds", "33", "--embedded-worker", "false"],
    )
    .unwrap();
    assert_eq!(
        (settings.lease_seconds, settings.max_attempts, settings.embedded_worker),
        (33, 4, false)
    );
}

/// Every setting has a flag and a variable, and they mean the same.
#[test]
fn every_setting_can_be_set_everywhere() {
    let values = [
        ("listen", "[::1]:7000"),
        ("metrics_listen", "127.0.0.1:9464"),
        ("page_listen", "127.0.0.1:8080"),
        ("access", "tokens"),
        ("allow_open_network", "true"),
        ("allow_raw_verification", "true"),
        ("tls_certificate", "/c.pem"),
        ("tls_key", "/k.pem"),
        ("tls_client_ca", "/ca.pem"),
        ("data_dir", "/data"),
        (
            "database",
            "postgres://somebody:5ec2e7@db.example/ledger?sslmode=verify-full",
        ),
        ("artifacts", "s3://bucket/prefix"),
        ("signed_url_seconds", "16"),
        ("max_artifact_bytes", "1000"),
        ("max_queued_jobs", "5"),
        ("max_queued_jobs_per_project", "11"),
        ("max_artifact_bytes_per_project", "12"),
        ("max_submissions_per_minute", "13"),
        ("max_claims_per_minute", "14"),
        ("max_calls_per_minute", "15"),
        ("max_priority", "5"),
        ("max_job_memory_mebibytes", "2000"),
        ("max_job_gigapixels", "22"),
        ("lease_seconds", "6"),
        ("progress_stall_seconds", "23"),
        ("max_attempts", "7"),
        ("upload_timeout_seconds", "8"),
        ("watch_stall_seconds", "20"),
        ("max_watches_per_caller", "21"),
        ("download_stall_seconds", "22"),
        ("max_transfers_per_caller", "23"),
        ("transfer_memory_mebibytes", "24"),
        ("max_connections", "25"),
        ("max_connections_per_address", "26"),
        ("connection_idle_seconds", "27"),
        ("abandoned_after_seconds", "9"),
        ("hook_allow_http", "true"),
        ("hook_allow_private", "true"),
        ("hook_ca", "/hooks.pem"),
        ("hook_give_up_seconds", "16"),
        ("keep_uploads_days", "17"),
        ("keep_outputs_days", "18"),
        ("keep_jobs_days", "19"),
        ("embedded_worker", "false"),
        ("worker_binary", "/bin/worker"),
        ("worker_device", "wgpu"),
        ("master_key_file", "/key"),
        ("false_positive_rate", "1e-9"),
        ("stop_seconds", "10"),
        ("log_format", "json"),
        ("log_filter", "debug,h2=warn"),
    ];
    let all = serde_json::to_value(Settings::default()).unwrap();
    assert_eq!(
        values.len(),
        all.as_object().unwrap().len(),
        "a setting is missing in this test"
    );
    let flags = Arguments::command();
    assert_eq!(
        flags.get_arguments().filter(|a| a.get_id() != "config").count(),
        values.len()
    );
    for (name, value) in values {
        let variable = format!("GUARDSPLAT_{}", name.to_uppercase());
        let flag = format!("--{}", name.replace('_', "-"));
        // Those of TLS go together, and the page goes with tokens.
        let besides = match name {
            "page_listen" => "access = \"tokens\"\n",
            "tls_certificate" => "tls_key = \"/k.pem\"\n",
            "tls_key" => "tls_certificate = \"/c.pem\"\n",
            "tls_client_ca" => "tls_key = \"/k.pem\"\ntls_certificate = \"/c.pem\"\n",
            _ => "",
        };
        let by_variable = layers(besides, &[(&variable, value)], &[]).unwrap();
        let by_flag = layers(besides, &[], &[&flag, value]).unwrap();
        let quoted = if value.parse::<u64>().is_ok() || value.parse::<bool>().is_ok() {
            value.into()
        } else {
            format!("{value:?}")
        };
        let by_file = layers(&format!("{besides}{name} = {quoted}"), &[], &[]).unwrap();
        let shown = |settings: &Settings| serde_json::to_value(settings).unwrap()[name].clone();
        assert_ne!(shown(&by_flag), all[name], "{name} stays at its default");
        assert_eq!(shown(&by_variable), shown(&by_flag), "{name}");
        assert_eq!(shown(&by_file), shown(&by_flag), "{name}");
    }
}

/// The file of defaults says what the defaults are: with every setting in it switched on, nothing changes.
#[test]
fn the_documented_file_equals_the_defaults() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/guardsplat-server.toml");
    let text = fs::read_to_string(path).unwrap();
    let as_json = |settings: &Settings| serde_json::to_value(settings).unwrap();
    let defaults = as_json(&Settings::default());
    assert_eq!(as_json(&layers(&text, &[], &[]).unwrap()), defaults);
    for (name, value) in defaults.as_object().unwrap() {
        // Settings without a default stand there as a comment, with an example.
        let line = if value.is_null() {
            format!("\n# {name} = ")
        } else {
            format!("\n{name} = ")
        };
        assert!(text.contains(&line), "{name} is not in the file of defaults");
    }
    let examples: String = text
        .lines()
        .filter_map(|line| line.strip_prefix("# "))
        .filter(|line| line.contains(" = "))
        .fold(String::new(), |all, line| all + line + "\n");
    // The page is for callers with tokens.
    assert!(error(&examples, &[], &[]).starts_with("setting page_listen: "));
    layers(&examples, &[], &["--access", "tokens"]).unwrap();
    assert_eq!(as_json(&parse(&text).unwrap()), defaults);
    assert!(parse("lease_seconds = 0").is_err());
}

#[test]
fn the_memory_of_jobs_is_limited_where_that_is_set() {
    assert_eq!(Settings::default().max_job_memory(), None);
    let settings = layers("max_job_memory_mebibytes = 3", &[], &[]).unwrap();
    assert_eq!(settings.max_job_memory(), Some(3 << 20));
}

#[test]
fn unknown_settings_are_named() {
    let text = error("max_atempts = 3", &[], &[]);
    assert!(text.contains("unknown field `max_atempts`"), "{text}");
    let text = error("", &[("GUARDSPLAT_MAX_ATEMPTS", "3")], &[]);
    assert!(text.contains("unknown field `max_atempts`"), "{text}");
    let text = error("[listen]\nport = 3", &[], &[]);
    assert!(text.contains("listen"), "{text}");
    // The master key is no setting.
    assert!(error(&format!("master_key = \"{SECRET}\""), &[], &[]).contains("unknown field `master_key`"));
}

#[test]
fn variables_of_others_do_not_matter() {
    let variables = [
        ("GUARDSPLAT_HOME", "/home"),
        ("GUARDSPLAT_SERVER", "http://localhost:1"),
        ("GUARDSPLAT_TOKEN", "gst_a_b"),
        ("GUARDSPLAT_TOKEN_FILE", "/token"),
        ("GUARDSPLAT_SERVICE_HOST", "10.0.0.1"),
        ("GUARDSPLAT_PORT_50051_TCP_ADDR", "10.0.0.1"),
        ("GUARDSPLAT_SERVER_PORT", "tcp://10.0.0.1:50051"),
        ("GUARDSPLAT_LISTEN", ""),
        ("LEASE_SECONDS", "1"),
    ];
    let settings = layers("", &variables, &[]).unwrap();
    assert_eq!(
        serde_json::to_value(settings).unwrap(),
        serde_json::to_value(Settings::default()).unwrap()
    );
}

#[test]
fn bad_values_are_told_with_setting_and_limit() {
    assert_eq!(
        error("lease_seconds = 0", &[], &[]),
        "setting lease_seconds: 0 is not between 1 and 86400"
    );
    assert_eq!(
        error("", &[], &["--max-artifact-bytes", "0"]),
        "setting max_artifact_bytes: 0 is not between 1 and 1099511627776"
    );
    assert_eq!(
        error("", &[("GUARDSPLAT_MAX_ATTEMPTS", "101")], &[]),
        "setting max_attempts: 101 is not between 1 and 100"
    );
    assert_eq!(
        error("", &[("GUARDSPLAT_MAX_JOB_MEMORY_MEBIBYTES", "16777217")], &[]),
        "setting max_job_memory_mebibytes: 16777217 is not between 0 and 16777216"
    );
    for rate in ["0.0", "0.5", "-1e-6", "nan"] {
        let text = error(&format!("false_positive_rate = {rate}"), &[], &[]);
        assert!(text.ends_with("is not between 1e-30 and 0.1"), "{text}");
    }
    assert_eq!(error("data_dir = \"\"", &[], &[]), "setting data_dir: an empty path");
    for filter in ["info,=[", "info,h2=loud", " =info"] {
        let text = error(&format!("log_filter = \"{filter}\""), &[], &[]);
        assert!(text.starts_with("setting log_filter: "), "{text}");
    }
    for (file, field) in [
        ("max_attempts = -1", "max_attempts"),
        ("max_attempts = 5000000000", "max_attempts"),
        ("max_attempts = \"three\"", "max_attempts"),
        ("listen = \"localhost\"", "listen"),
        ("worker_device = \"gpu\"", "worker_device"),
        ("log_format = \"xml\"", "log_format"),
        ("embedded_worker = \"maybe\"", "embedded_worker"),
    ] {
        let text = error(file, &[], &[]);
        assert!(text.contains(field), "{file}: {text}");
    }
}

#[test]
fn spaces_around_targets_of_the_log_do_not_matter() {
    let filter = |text: &str| {
        let settings = layers(&format!("log_filter = \"{text}\""), &[], &[]).unwrap();
        settings.log_filter().unwrap().to_string()
    };
    assert_eq!(
        filter(" info, h2=warn,\u{2003}il\u{456}=debug "),
        filter("info,h2=warn,il\u{456}=debug")
    );
}

#[test]
fn nobody_is_open_to_a_network_by_oversight() {
    for address in ["0.0.0.0:50051", "[::]:50051", "192.0.2.7:50051"] {
        let listen = ["--listen", address];
        let text = error("", &[], &listen);
        assert!(
            text.starts_with("setting listen: ") && text.contains("allow_open_network"),
            "{text}"
        );
        layers("access = \"tokens\"", &[], &listen).unwrap();
        layers("allow_open_network = true", &[], &listen).unwrap();
    }
    for address in ["127.0.0.2:1", "[::1]:0"] {
        layers("", &[], &["--listen", address]).unwrap();
    }
}

#[test]
fn half_of_tls_is_told() {
    let missing = |file: &str| error(file, &[], &[]);
    assert!(missing("tls_key = \"k\"").starts_with("setting tls_certificate: is missing"));
    assert!(missing("tls_certificate = \"c\"").starts_with("setting tls_key: is missing"));
    assert!(missing("tls_client_ca = \"a\"").starts_with("setting tls_certificate: is missing"));
    let both = "tls_key = \"k\"\ntls_certificate = \"c\"";
    let listen = ["--listen", "0.0.0.0:1"];
    assert!(error(both, &[], &listen).starts_with("setting listen: "));
    layers(&format!("{both}\ntls_client_ca = \"a\""), &[], &listen).unwrap();
}

#[test]
fn a_file_that_is_missing_or_no_toml_is_named() {
    let flags = Flags {
        config: Some("/nowhere/server.toml".into()),
        ..Flags::default()
    };
    let text = load(flags, []).unwrap_err().to_string();
    assert!(text.contains("/nowhere/server.toml"), "{text}");
    let text = error("lease_seconds = ", &[], &[]);
    assert!(text.contains("lease_seconds"), "{text}");
}

#[test]
fn the_master_key_is_not_shown() {
    let settings = layers("", &[("GUARDSPLAT_MASTER_KEY", SECRET)], &[]).unwrap();
    assert!(settings.master_key.is_some());
    assert!(!format!("{settings:?}").contains("5ec2e7"));
    assert!(!serde_json::to_string(&settings).unwrap().contains("5ec2e7"));
    assert!(
        layers("", &[("GUARDSPLAT_MASTER_KEY", "")], &[])
            .unwrap()
            .master_key
            .is_none()
    );
}

/// Wherever it stands, and whatever is wrong with it.
#[test]
fn the_password_of_the_database_is_not_shown() {
    let settings = layers("database = \"postgres://a:5ec2e7@db/ledger\"", &[], &[]).unwrap();
    for shown in [format!("{settings:?}"), serde_json::to_string(&settings).unwrap()] {
        assert!(shown.contains("@db/ledger") && !shown.contains("5ec2e7"), "{shown}");
    }
    for url in [
        "mysql://a:5ec2e7@db/ledger",
        "5ec2e7",
        "postgres://a:5ec2e7@db:port/ledger",
        "postgres://a:x?5ec2e7@db/ledger",
        "postgres://db/ledger?passwrod=5ec2e7",
        "postgres://a:5ec2e7@db/ledger?sslmode=sometimes",
    ] {
        for text in [
            error(&format!("database = \"{url}\""), &[], &[]),
            error("", &[("GUARDSPLAT_DATABASE", url)], &[]),
            error("", &[], &["--database", url]),
        ] {
            assert!(text.starts_with("setting database: "), "{text}");
            assert!(!text.contains("5ec2e7"), "{text}");
        }
    }
    for broken in [
        "database = \"postgres://a:5ec2e7@db/ledger",
        "database = postgres://a:5ec2e7@db/ledger",
        "database = [\"postgres://a:5ec2e7@db/ledger\"]",
    ] {
        let text = error(broken, &[], &[]);
        assert!(!text.contains("5ec2e7"), "{text}");
    }
}

/// A URL of a store takes no credentials; one that has some is refused, and they are not repeated.
#[test]
fn credentials_in_the_url_of_the_store_are_not_shown() {
    for url in ["s3://id:5ec2e7@bucket", "https://5ec2e7.example", "az://c?sig=5ec2e7"] {
        for text in [
            error(&format!("artifacts = \"{url}\""), &[], &[]),
            error("", &[("GUARDSPLAT_ARTIFACTS", url)], &[]),
            error("", &[], &["--artifacts", url]),
        ] {
            assert!(
                text.starts_with("setting artifacts: ") && !text.contains("5ec2e7"),
                "{text}"
            );
        }
    }
}

#[test]
fn the_command_line_is_sound() {
    Arguments::command().debug_assert();
}

#[test]
fn help_tells_the_defaults() {
    let defaults = serde_json::to_value(Settings::default()).unwrap();
    let command = Arguments::command();
    for (name, value) in defaults.as_object().unwrap() {
        let flag = command.get_arguments().find(|flag| flag.get_id() == name.as_str());
        let help = flag
            .and_then(|flag| flag.get_help())
            .unwrap_or_else(|| panic!("--{name}"))
            .to_string();
        let wanted = match value {
            serde_json::Value::Null => "[default: ".to_owned(),
            serde_json::Value::String(text) => format!("[default: {text}]"),
            other => format!("[default: {other}]"),
        };
        assert!(help.contains(&wanted), "{name}: {help}");
    }
}
