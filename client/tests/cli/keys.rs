//! `key`.
use guardsplat_proto::v1::KeyResult;
use guardsplat_proto::v1::job::{Result as Outcome, Spec};

use super::fake::{KEY, key, success};
use super::run::{PICTURE, TestEnvironment};

#[test]
fn a_key_is_made_and_told() {
    let environment = TestEnvironment::new();
    let result = KeyResult {
        key: KEY.into(),
        bit_accuracy_unseen: Some(0.975),
        device: "cpu".into(),
        ..KeyResult::default()
    };
    environment.fake.plan([success(Outcome::KeyResult(result))]);
    let ran = environment.run("key create --bits 32 --seed 7 --display-name website --json");
    assert_eq!(ran.code, 0, "{}", ran.err);
    let json = ran.json();
    assert_eq!(
        (&json["key"], &json["bits"], &json["clip"]),
        (&KEY.into(), &32.into(), &"guardsplat".into())
    );
    assert_eq!(json["bit_accuracy_unseen"], 0.975);
    assert!(json["bit_accuracy_unseen_noisy"].is_null());
    let job = environment.fake.state().created[0].job.clone().unwrap();
    assert_eq!(job.display_name, "website");
    let Some(Spec::CreateKey(spec)) = job.spec else {
        panic!()
    };
    assert_eq!((spec.bits, spec.seed), (32, Some(7)));
}

#[test]
fn keys_are_listed_over_pages() {
    let environment = TestEnvironment::new();
    for n in 0..4 {
        environment
            .fake
            .state()
            .keys
            .push(key(&format!("keys/{n}"), "other", 20));
    }
    let json = environment.run("key list --json").json();
    let keys = json["keys"].as_array().unwrap();
    assert_eq!(keys.len(), 5);
    assert_eq!(
        (&keys[0]["name"], &keys[0]["display_name"]),
        (&KEY.into(), &"website".into())
    );
    let text = environment.run("key list").out;
    assert!(
        text.starts_with(&format!("{KEY}  32 bits  guardsplat  website\n")),
        "{text}"
    );
}

#[test]
fn a_display_name_that_two_keys_have_is_not_guessed() {
    let environment = TestEnvironment::new();
    environment.fake.state().keys.push(key("keys/1", "website", 32));
    environment.file("a.png", PICTURE);
    let ran = environment.run("verify a.png --key website");
    assert_eq!(ran.code, 1);
    assert!(ran.err.contains("2 keys are called `website`"), "{}", ran.err);
}

#[test]
fn names_from_elsewhere_do_not_steer_the_terminal() {
    let environment = TestEnvironment::new();
    environment
        .fake
        .state()
        .keys
        .push(key("keys/1", "\u{1b}]0;owned\u{7}", 32));
    let text = environment.run("key list").out;
    assert!(!text.contains('\u{1b}') && text.contains("owned"), "{text}");
}
