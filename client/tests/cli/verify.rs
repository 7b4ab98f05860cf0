//! `verify`: verdicts, their exit codes, and what is sent.
use guardsplat_proto::v1::VerifyResult;
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::verify_result::Verdict;

use super::fake::{KEY, success};
use super::run::{PICTURE, TestEnvironment};

fn result(verdict: Verdict) -> VerifyResult {
    let mut result = VerifyResult {
        bits: 32,
        views: 3,
        message: "c0ffee43".into(),
        mean_abs_logit: 1.5,
        view_agreement: 0.9,
        device: "cpu".into(),
        clip: "guardsplat".into(),
        ..VerifyResult::default()
    };
    result.set_verdict(verdict);
    if verdict == Verdict::Inconclusive {
        result.reason = "nothing to compare with".into();
    } else {
        result.p_value = Some(7.5e-9);
        result.threshold = Some(1e-6);
        result.matched_bits = Some(31);
        result.rank_sum = Some(520);
        result.needed_rank_sum = Some(494);
        result.bit_accuracy = Some(0.875);
        result.bit_accuracy_worst_view = Some(0.75);
    }
    result
}

fn environment(verdict: Verdict) -> TestEnvironment {
    let environment = TestEnvironment::new();
    environment.fake.plan([success(Outcome::VerifyResult(result(verdict)))]);
    std::fs::create_dir(environment.path("views")).unwrap();
    for name in ["b.png", "a.jpg", "notes.txt"] {
        environment.file(&format!("views/{name}"), name.as_bytes());
    }
    environment.file("c.webp", PICTURE);
    environment
}

#[test]
fn a_match_exits_with_0_and_tells_the_figures() {
    let environment = environment(Verdict::Match);
    let ran = environment.run("verify views c.webp --key website --message c0ffee42 --json");
    assert_eq!(ran.code, 0, "{}", ran.err);
    let json = ran.json();
    assert_eq!((&json["verdict"], &json["key"]), (&"match".into(), &KEY.into()));
    assert_eq!((&json["p_value"], &json["threshold"]), (&7.5e-9.into(), &1e-6.into()));
    assert_eq!(
        (&json["rank_sum"], &json["needed_rank_sum"]),
        (&520.into(), &494.into())
    );
    assert_eq!(
        (&json["bits"], &json["views"], &json["message"]),
        (&32.into(), &3.into(), &"c0ffee43".into())
    );
    assert!(json["reason"].is_null());

    let state = environment.fake.state();
    let Some(Spec::Verify(spec)) = state.created[0].job.as_ref().unwrap().spec.clone() else {
        panic!("{:?}", state.created);
    };
    let sent: Vec<&[u8]> = spec.suspects.iter().map(|name| &state.artifacts[name].1[..]).collect();
    assert_eq!(sent, [b"a.jpg" as &[u8], b"b.png", PICTURE]);
    assert_eq!((spec.views, spec.size, spec.message.as_str()), (0, 0, "c0ffee42"));
}

#[test]
fn no_match_exits_with_2() {
    let ran = environment(Verdict::NoMatch).run("verify c.webp --key website --message c0ffee42");
    assert_eq!(ran.code, 2, "{}", ran.err);
    let expected = "no match: 31 of 32 bits, p = 7.50e-9 (threshold 1e-6); 87.50 % of bits a view, worst 75.00 %; \
                    read c0ffee43 from 3 views; views agree on 90.0 % of bits, mean logit 1.50\n";
    assert_eq!(ran.out, expected);
}

#[test]
fn nothing_decided_exits_with_3() {
    let environment = environment(Verdict::Inconclusive);
    let ran = environment.run("verify c.webp --key website --json");
    assert_eq!(ran.code, 3, "{}", ran.err);
    let json = ran.json();
    assert_eq!(
        (&json["verdict"], &json["reason"]),
        (&"inconclusive".into(), &"nothing to compare with".into())
    );
    assert!(json["p_value"].is_null() && json["matched_bits"].is_null());
}

#[test]
fn views_of_a_scene_can_be_chosen() {
    let environment = environment(Verdict::Match);
    // By its first bytes a scene; names say nothing.
    environment.file("s.png", b"NGSP and so on");
    let ran = environment.run("verify s.png --key website --message c0ffee42 --views 5 --size 64 --seed 3");
    assert_eq!(ran.code, 0, "{}", ran.err);
    let created = environment.fake.state().created[0].job.clone().unwrap();
    let Some(Spec::Verify(spec)) = created.spec else {
        panic!()
    };
    assert_eq!((spec.views, spec.size, spec.seed, spec.suspects.len()), (5, 64, 3, 1));
}
