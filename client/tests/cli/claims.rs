//! `owner`, `asset`, `report`, and `embed` and `verify` with what is registered.
use guardsplat_evidence::{
    Audience, Evidence, EvidenceKind, History, Key, Model, Multiplicity, SCHEMA, Sha256, SigningKey, Timestamp, Tried,
    VERSION, Verdict as Told, Verification, sign,
};
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::{VerifyResult, verify_result::Verdict};
use sha2::Digest;

use super::fake::{KEY, figures, success};
use super::run::TestEnvironment;

const ASSET: &str = "assets/0190a5d0-0000-7000-8000-00000000000b";

fn spec(environment: &TestEnvironment) -> Spec {
    environment.fake.state().created[0].job.clone().unwrap().spec.unwrap()
}

#[test]
fn owners_and_assets_are_registered_and_told() {
    let environment = TestEnvironment::new();
    let owner = environment.run("owner create studio --json").json();
    let name = owner["name"].as_str().unwrap().to_owned();
    assert_eq!(environment.run("owner show studio --json").json(), owner);
    assert_eq!(
        environment.run(&format!("owner show {name}")).out,
        format!("{name}  studio\n")
    );
    assert_eq!(environment.run("owner list --json").json()["owners"][0], owner);
    let told = environment.run("owner show nobody --json");
    assert!(
        told.code == 1 && told.err.contains("there is no owner `nobody`"),
        "{}",
        told.err
    );

    environment.file("scene.ply", b"ply\n");
    let made = environment.run("asset create scene.ply --owner studio --key website");
    assert_eq!(made.code, 0, "{}", made.err);
    let registered = environment.fake.state().registered[0].clone();
    assert_eq!((&registered.owner, registered.key.as_str()), (&name, KEY));
    assert_eq!(registered.display_name, "scene.ply");
    let hash = hex::encode(sha2::Sha256::digest(b"ply\n"));
    assert_eq!(registered.original, Some(Original::Sha256(hash.clone())));
    // Nothing but the hash was sent.
    assert_eq!(environment.fake.state().uploads, 0);
    let shown = environment
        .run(&format!("asset show {} --json", made.out.trim()))
        .json();
    assert_eq!((&shown["sha256"], &shown["owner"]), (&hash.into(), &name.into()));
    let listed = environment.run("asset list --owner studio --key website --json").json();
    assert_eq!((&listed["assets"][0], &listed["more"]), (&shown, &false.into()));
}

#[test]
fn an_asset_is_marked_in_place_of_a_message() {
    let environment = TestEnvironment::new();
    environment.file("in.ply", b"ply\n");
    let mut result = figures(&environment.fake.store("marked.ply", b"ply\nmarked"), "artifacts/c");
    result.message.clear();
    result.evidence_html = "artifacts/e".into();
    environment.fake.plan([success(Outcome::EmbedResult(result))]);
    let ran = environment.run(&format!("embed in.ply -o out.ply --key website --asset {ASSET} --json"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    let json = ran.json();
    assert!(
        json["message"].is_null() && json["evidence_html"] == "artifacts/e",
        "{json}"
    );
    let Spec::Embed(spec) = spec(&environment) else {
        panic!()
    };
    assert_eq!((spec.asset.as_str(), spec.message.as_str()), (ASSET, ""));
}

#[test]
fn a_claim_tells_whose_mark_was_found_and_what_was_tried() {
    let environment = TestEnvironment::new();
    environment.file("s.ply", b"ply\n");
    environment.run("owner create studio");
    let mut found = VerifyResult {
        p_value: Some(1e-12),
        threshold: Some(1e-6),
        matched_bits: Some(63),
        bits: 64,
        views: 20,
        hypotheses: Some(24),
        framings: 8,
        assets: 3,
        framing: "mirrored".into(),
        asset: ASSET.into(),
        owner: "owners/o".into(),
        payload_number: Some(2),
        corrected_bits: Some(1),
        evidence_html: "artifacts/e".into(),
        ..VerifyResult::default()
    };
    found.set_verdict(Verdict::Match);
    environment.fake.plan([success(Outcome::VerifyResult(found.clone()))]);
    let ran = environment.run("verify s.ply --key website --owner studio");
    assert_eq!(ran.code, 0, "{}", ran.err);
    let expected = format!(
        "match with {ASSET} of owners/o: 63 of 64 bits, 1 corrected, p = 1.00e-12 (threshold 1e-6) after 24 \
         hypotheses: 8 framings, 3 assets; 20 views, best mirrored\nevidence: artifacts/e\n"
    );
    assert_eq!(ran.out, expected);
    let Spec::Verify(spec) = spec(&environment) else {
        panic!()
    };
    assert_eq!(spec.owner, environment.fake.state().owners[0].name);

    found.set_verdict(Verdict::UnknownKey);
    found.matched_bits = None;
    environment.fake.plan([success(Outcome::VerifyResult(found))]);
    let ran = environment.run("verify s.ply --key website --search --json");
    assert_eq!(ran.code, 3, "{}", ran.err);
    let json = ran.json();
    assert_eq!(
        (&json["verdict"], &json["hypotheses"]),
        (&"unknown_key".into(), &24.into())
    );
    assert!(json["message"].is_null() && json["asset"] == ASSET, "{json}");
}

#[test]
fn who_is_no_admin_is_told_the_verdict_and_what_it_took() {
    let environment = TestEnvironment::new();
    environment.file("s.ply", b"ply\n");
    let mut found = VerifyResult {
        p_value: Some(1e-6),
        threshold: Some(1e-6),
        bits: 64,
        views: 20,
        hypotheses: Some(24_000),
        framings: 8,
        assets: 1,
        assets_paid: 1000,
        readings_paid: 3,
        asset: ASSET.into(),
        owner: "owners/o".into(),
        redacted: true,
        ..VerifyResult::default()
    };
    found.set_verdict(Verdict::Match);
    environment.fake.plan([success(Outcome::VerifyResult(found.clone()))]);
    let ran = environment.run(&format!("verify s.ply --key website --asset {ASSET}"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    let expected = format!(
        "match with {ASSET} of owners/o, p <= 1e-6 after 24000 hypotheses: 8 framings, 1 of 1000 assets, reading 3 of \
         these files\nhow near it was, and the evidence, are for admins\n"
    );
    assert_eq!(ran.out, expected);
    found.set_verdict(Verdict::NoMatch);
    (found.p_value, found.asset, found.owner) = (None, String::new(), String::new());
    environment.fake.plan([success(Outcome::VerifyResult(found))]);
    let ran = environment.run(&format!("verify s.ply --key website --asset {ASSET} --json"));
    assert_eq!(ran.code, 2, "{}", ran.err);
    let json = ran.json();
    for hidden in [
        "p_value",
        "matched_bits",
        "rank_sum",
        "mean_abs_logit",
        "view_agreement",
        "framing",
        "corrected_bits",
    ] {
        assert!(json[hidden].is_null(), "{hidden}: {json}");
    }
    assert_eq!((&json["redacted"], &json["assets_paid"]), (&true.into(), &1000.into()));
}

/// A signed report of a key that nothing is registered for.
pub fn report(key: &SigningKey) -> guardsplat_evidence::Signed {
    let now = Timestamp::from_second(1_800_000_000).unwrap();
    let evidence = Evidence {
        schema: SCHEMA.into(),
        version: VERSION,
        audience: Audience::Owner,
        kind: EvidenceKind::Verify,
        job: "jobs/1".into(),
        started: now,
        finished: now,
        engine: "a test".into(),
        device: "cpu".into(),
        worker: None,
        model: Model {
            name: "guardsplat".into(),
            sha256: Sha256([1; 32]),
        },
        key: Key { id: KEY.into() },
        inputs: Vec::new(),
        verification: Some(Verification {
            verdict: Told::UnknownKey,
            reason: None,
            note: None,
            tried: Tried {
                paid: Some(Multiplicity { assets: 1, readings: 1 }),
                ..Tried::once()
            },
            views: 0,
            decision: None,
            history: Some(History {
                first_seen: now,
                readings_of_key: 1,
                assets_of_owner: None,
                asset: None,
            }),
            found: None,
            strip: Vec::new(),
        }),
        embedding: None,
        views: Vec::new(),
    };
    sign(&evidence, key).unwrap()
}

#[test]
fn reports_are_fetched_and_checked_with_and_without_a_server() {
    let environment = TestEnvironment::new();
    let key = SigningKey::from_bytes(&[7; 32]);
    let public = hex::encode(key.verifying_key().as_bytes());
    environment.fake.state().public_key = public.clone();
    let signed = report(&key);
    let mut result = VerifyResult {
        evidence_html: environment.fake.store("evidence.html", signed.html.as_bytes()),
        evidence_json: environment.fake.store("evidence.json", signed.json.as_bytes()),
        ..VerifyResult::default()
    };
    result.set_verdict(Verdict::UnknownKey);
    environment.file("s.ply", b"ply\n");
    environment.run("verify s.ply --key website --search --no-wait");
    let job = environment.fake.state().jobs.keys().next().unwrap().clone();
    let none = environment.run(&format!("report open {job} -o reports"));
    assert!(none.code == 1 && none.err.contains("left no report"), "{}", none.err);
    environment.fake.state().jobs.get_mut(&job).unwrap().result = Some(Outcome::VerifyResult(result));
    let opened = environment.run(&format!("report open {job} -o reports --json"));
    assert_eq!(opened.code, 0, "{}", opened.err);
    assert_eq!(opened.json()["html"], "reports/evidence.html");

    environment.file("key.hex", public.as_bytes());
    for file in ["reports/evidence.html", "reports/evidence.json"] {
        let asked = environment.run(&format!("report check {file} --json"));
        assert_eq!(
            (asked.code, &asked.json()["answer"]),
            (0, &"genuine".into()),
            "{}",
            asked.err
        );
        let mut alone = environment.command(&format!(
            "--server http://127.0.0.1:1 report check {file} --public-key key.hex"
        ));
        assert_eq!(alone.output().unwrap().status.code(), Some(0), "{file}");
    }
    environment.file(
        "other.hex",
        hex::encode(SigningKey::from_bytes(&[8; 32]).verifying_key()).as_bytes(),
    );
    let other = environment.run("report check reports/evidence.json --public-key other.hex --json");
    assert_eq!((other.code, &other.json()["answer"]), (2, &"wrong_key".into()));
    environment.file("changed.json", signed.json.replace("a test", "the test").as_bytes());
    let changed = environment.run("report check changed.json --public-key key.hex");
    assert_eq!(changed.code, 2);
    assert!(changed.out.starts_with("altered: "), "{}", changed.out);
    assert_eq!(environment.run("report check none.json --public-key key.hex").code, 1);
    assert_eq!(
        environment
            .run("report check changed.json --public-key changed.json")
            .code,
        1
    );
}
