//! What the server reads.
use super::{put, put_damaged};
use guardsplat_fuzz as _;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{CreateJobRequest, EmbedSpec, Job, KeySpec, UploadMetadata, VerifySpec};
use guardsplat_server::secrets::MasterKey;
use prost::Message as _;

const ID: &str = "01890a5d-ac96-774b-bcce-b302099a8057";

pub fn put_all() {
    requests();
    let payload = format!("01{}{}", "0".repeat(16), "5a".repeat(16));
    put("page_token", "other-check", format!("{payload}{}", "0".repeat(24)));
    put("page_token", "short", &payload[..20]);
    put("page_token", "none", "");
    put("page_token", "other-case", format!("{payload}{}", "AB".repeat(12)));
    for (name, text) in [
        ("job", format!("jobs/{ID}")),
        ("artifact", format!("artifacts/{ID}")),
        ("key", format!("keys/{ID}")),
        ("other-spelling", format!("keys/{{{ID}}}")),
        ("folders", "../../etc/passwd".into()),
        ("line", "two\nlines".into()),
        ("direction", "gnp\u{202e}exe".into()),
        ("long", "é".repeat(300)),
        ("usual", "a scene, № 3.ply".into()),
    ] {
        put("names", name, text);
    }
    let master = MasterKey::from_hex(&"0".repeat(64), "seeds").expect("64 digits are a key");
    put_damaged(
        "sealed",
        "right",
        &master.seal("keys/fuzz", b"a secret").expect("it is sealed"),
    );
    put(
        "sealed",
        "other-context",
        master.seal("keys/other", b"a secret").expect("it is sealed"),
    );
    put(
        "sealed",
        "other-version",
        b"GSSL\x02 and what follows in a version that is not known yet, in bytes",
    );
    put("sealed", "master-key", "5e".repeat(32));
    put("server_settings", "some", SETTINGS);
    put("server_settings", "unknown", "max_atempts = 3");
    put("server_settings", "too-much", "lease_seconds = 99999999999999999999");
    put(
        "server_settings",
        "filter",
        "log_filter = \"info,a[b{c=d}]=trace,/.*/=x\"",
    );
    // Found by the fuzzer: the expression took gigabytes.
    put(
        "server_settings",
        "span-filter",
        "log_filter = \"info,a[b{BBBBeconBBBBBBBbBBBBBBBBBBB.......log_format = .......................BBBBBBBBBB..............................BBBBBBBBBBBBBBBBBBBBds }c=x\"",
    );
    // Found by the fuzzer: the library panicked inside of the last letter.
    put("server_settings", "filter-after-space", "log_filter = \" il\u{456}=\"");
    put("server_settings", "table", "[listen]\nport = 3\n[[listen]]");
    put(
        "server_settings",
        "deep",
        format!("a = {}{}", "[".repeat(200), "]".repeat(200)),
    );
}

fn requests() {
    let spec = |spec| CreateJobRequest {
        job: Some(Job {
            display_name: "a seed".into(),
            spec: Some(spec),
            ..Job::default()
        }),
        request_id: ID.into(),
    };
    let embed = EmbedSpec {
        scene: format!("artifacts/{ID}"),
        key: format!("keys/{ID}"),
        message: "c0ffee42".into(),
        ..EmbedSpec::default()
    };
    let verify = VerifySpec {
        suspects: vec![format!("artifacts/{ID}"); 2],
        key: format!("keys/{ID}"),
        views: 5,
        ..VerifySpec::default()
    };
    let key = KeySpec {
        bits: 32,
        ..KeySpec::default()
    };
    put_damaged("requests", "embed", &spec(Spec::Embed(embed)).encode_to_vec());
    put_damaged("requests", "verify", &spec(Spec::Verify(verify)).encode_to_vec());
    put_damaged("requests", "create-key", &spec(Spec::CreateKey(key)).encode_to_vec());
    put("requests", "nothing", CreateJobRequest::default().encode_to_vec());
    let announced = UploadMetadata {
        display_name: "scene.ply".into(),
        size_bytes: 100,
        sha256: "ab".repeat(32),
    };
    put_damaged("requests", "upload", &announced.encode_to_vec());
    put("requests", "groups", [0x0b; 200]);
}

const SETTINGS: &str = r#"listen = "127.0.0.1:7000"
data_dir = "/data" # where it is
max_artifact_bytes = 1_000
embedded_worker = false
worker_device = "cpu"
log_filter = "debug,h2=warn"
"#;
