//! The program: scenes signed and checked, changed, and sidecars that strangers made.
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use guardsplat_soft_binding::{BindingKey, Value};
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose,
};
use serde_json::Value as Json;
use tempfile::TempDir;

const KEY: BindingKey<'_> = BindingKey {
    id: "00112233445566778899aabbccddeeff",
    secret: &[7; 32],
};

/// What names the mark.
fn value() -> String {
    let message = guardsplat_soft_binding::Message::parse("c0ffee42", 32).unwrap();
    Value::seal(KEY, &message).unwrap().text()
}

struct Bench(TempDir);

impl Bench {
    /// A folder with a scene and a marked one; credentials ask nothing of what is in them.
    fn new() -> Self {
        let bench = Self(TempDir::new().unwrap());
        std::fs::write(bench.path("scene.ply"), b"ply\noriginal").unwrap();
        std::fs::write(bench.path("marked.ply"), vec![7; 100_000]).unwrap();
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, line: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_guardsplat-credentials"))
            .args(line.split_whitespace())
            .current_dir(self.0.path())
            .output()
            .unwrap()
    }

    /// Standard output, or standard error for code 1.
    fn exits(&self, line: &str, code: i32) -> String {
        let output = self.run(line);
        let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
        assert_eq!(output.status.code(), Some(code), "{line}: {out}{err}");
        if code == 1 { err } else { out }
    }

    fn json(&self, line: &str, code: i32) -> Json {
        serde_json::from_str(&self.exits(line, code)).unwrap()
    }

    fn sign(&self, more: &str) -> String {
        let value = value();
        self.exits(
            &format!("sign scene.ply marked.ply marked.ply.c2pa --soft-binding {value} {more}"),
            0,
        )
    }
}

/// An authority and a certificate below it, as operators are given them.
fn certificates(bench: &Bench) {
    let mut authority = CertificateParams::new([]).unwrap();
    authority.distinguished_name.push(DnType::CommonName, "An authority");
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    authority.key_usages = vec![KeyUsagePurpose::KeyCertSign];
    let key = KeyPair::generate().unwrap();
    let root = authority.self_signed(&key).unwrap();
    let issuer = Issuer::new(authority, key);

    let mut own = CertificateParams::new([]).unwrap();
    own.distinguished_name.push(DnType::CommonName, "Studio Nord");
    own.distinguished_name.push(DnType::OrganizationName, "Studio Nord AB");
    own.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    own.extended_key_usages = vec![ExtendedKeyUsagePurpose::EmailProtection];
    own.use_authority_key_identifier_extension = true;
    own.is_ca = IsCa::ExplicitNoCa;
    let key = KeyPair::generate().unwrap();
    let certificate = own.signed_by(&key, &issuer).unwrap();
    std::fs::write(bench.path("root.pem"), root.pem()).unwrap();
    std::fs::write(bench.path("chain.pem"), certificate.pem() + &root.pem()).unwrap();
    std::fs::write(bench.path("key.pem"), key.serialize_pem()).unwrap();
}

#[test]
fn a_test_certificate_is_said_to_be_one() {
    let bench = Bench::new();
    assert!(bench.sign("").contains("test certificate"));
    let report = bench.json("check marked.ply marked.ply.c2pa --json", 3);
    assert_eq!(
        (&report["verdict"], &report["test_certificate"]),
        (&"untrusted".into(), &true.into())
    );
    assert_eq!(report["signed_by"], "guardsplat-test-certificate.invalid");
    assert_eq!(report["original_title"], "scene.ply");
    assert!(
        report["original"].as_str().unwrap().starts_with("ni:///sha-256;"),
        "{report}"
    );
    assert_eq!(report["marked_with_keys"], serde_json::json!([KEY.id]));
    assert_eq!(report["failures"], serde_json::json!([]));
    let told = bench.exits("check marked.ply marked.ply.c2pa", 3);
    assert!(told.contains("test certificate, which anybody can make"), "{told}");
    // The message is in it for those alone who have the key.
    let bytes = std::fs::read(bench.path("marked.ply.c2pa")).unwrap();
    for message in [&b"c0ffee42"[..], &[0xc0, 0xff, 0xee, 0x42]] {
        assert!(!bytes.windows(message.len()).any(|part| part == message));
    }
}

#[test]
fn an_operators_certificate_is_trusted_by_who_trusts_its_authority() {
    let bench = Bench::new();
    certificates(&bench);
    let said = bench.sign("--certificate chain.pem --private-key key.pem --algorithm es256");
    assert!(!said.contains("test certificate"), "{said}");
    let report = bench.json("check marked.ply marked.ply.c2pa --json --trust root.pem", 0);
    assert_eq!(report["verdict"], "trusted");
    assert_eq!(
        (&report["signed_by"], &report["organisation"]),
        (&"Studio Nord".into(), &"Studio Nord AB".into())
    );
    let report = bench.json("check marked.ply marked.ply.c2pa --json", 3);
    assert_eq!(
        (&report["verdict"], &report["test_certificate"]),
        (&"untrusted".into(), &false.into())
    );
    // A stranger's authority vouches for nobody here.
    let other = Bench::new();
    certificates(&other);
    std::fs::copy(other.path("root.pem"), bench.path("other.pem")).unwrap();
    bench.exits("check marked.ply marked.ply.c2pa --trust other.pem", 3);
}

#[test]
fn what_was_changed_is_told() {
    let bench = Bench::new();
    bench.sign("");
    let mut scene = std::fs::read(bench.path("marked.ply")).unwrap();
    scene[50_000] ^= 1;
    std::fs::write(bench.path("changed.ply"), &scene).unwrap();
    let told = bench.exits("check changed.ply marked.ply.c2pa", 2);
    assert!(told.contains("the scene is not the one that was signed"), "{told}");
    // The name of the original, which is said in the manifest, is signed, too.
    let mut sidecar = std::fs::read(bench.path("marked.ply.c2pa")).unwrap();
    let place = sidecar.windows(9).position(|part| part == b"scene.ply").unwrap();
    sidecar[place] = b'S';
    std::fs::write(bench.path("forged.c2pa"), &sidecar).unwrap();
    let report = bench.json("check marked.ply forged.c2pa --json", 2);
    assert_eq!(report["verdict"], "invalid");
    let told = bench.json("marks forged.c2pa marked.ply.c2pa", 0);
    assert_eq!(
        (&told[0]["intact"], &told[1]["intact"]),
        (&false.into(), &true.into()),
        "{told}"
    );
    assert_eq!(told[1]["marks"].as_array().unwrap().len(), 1);
}

#[test]
fn refusals_say_what_to_do() {
    let bench = Bench::new();
    let value = "--soft-binding ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2";
    let error = bench.exits(&format!("sign scene.ply gone.ply o.c2pa {value}"), 1);
    assert!(error.contains("gone.ply"), "{error}");
    let error = bench.exits(&format!("sign scene.ply . o.c2pa {value}"), 1);
    assert!(error.contains("convert the scene to .sog"), "{error}");
    let error = bench.exits("sign scene.ply marked.ply o.c2pa --soft-binding c0ffee42", 1);
    assert!(
        error.contains("--soft-binding") && error.contains("too short"),
        "{error}"
    );
    certificates(&bench);
    let line = format!("sign scene.ply marked.ply o.c2pa {value} --certificate root.pem --private-key key.pem");
    let error = bench.exits(&line, 1);
    assert!(error.contains("root.pem (es256)"), "{error}");
    assert!(!Path::new(&bench.path("o.c2pa")).exists());
    std::fs::write(bench.path("none.c2pa"), b"PK").unwrap();
    let error = bench.exits("check marked.ply none.c2pa", 1);
    assert!(error.contains("none.c2pa: not content credentials"), "{error}");
}

#[test]
fn a_strangers_sidecar_is_read_or_refused() {
    let bench = Bench::new();
    bench.sign("");
    let whole = std::fs::read(bench.path("marked.ply.c2pa")).unwrap();
    // Cut short, and with a byte changed, everywhere in turns; a panic would be another exit code. The zeros are what
    // the signature is filled up with, of which nothing is signed.
    let places: Vec<usize> = (0..whole.len()).filter(|&place| whole[place] != 0).collect();
    let mut names = String::new();
    for part in 0..250 {
        let place = places[part * places.len() / 250];
        let mut changed = whole.clone();
        changed[place] = changed[place].wrapping_add(1 + (part % 255) as u8);
        for (name, bytes) in [("cut", &whole[..place]), ("changed", &changed)] {
            let name = format!("{name}{part}.c2pa");
            std::fs::write(bench.path(&name), bytes).unwrap();
            names = names + &name + " ";
        }
    }
    let told = bench.json(&format!("marks {names}"), 0);
    let told = told.as_array().unwrap();
    assert_eq!(told.len(), 500);
    let intact: Vec<_> = told.iter().filter(|sidecar| sidecar["intact"] == true).collect();
    // Little is not signed: the length of the outermost box, certificates above the signer's, which are checked where one of
    // them is trusted.
    assert!(intact.len() < 10, "{intact:?}");
    for sidecar in intact {
        assert_eq!(sidecar["marks"], serde_json::json!([value()]));
    }
}
