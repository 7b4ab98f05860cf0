//! The JSON of reports: the same bytes again, within limits, and nothing that it can't mean; and reports that were signed by
//! versions of before, kept as they were then.
#[path = "../examples/samples/mod.rs"]
mod samples;

use guardsplat_codeword::chance;
use guardsplat_evidence::{
    Answer, Decision, Error, Evidence, HypothesisGroup, HypothesisKind, Signed, check, limits, sign,
};
use proptest::prelude::*;
use std::sync::LazyLock;

/// Reports for properties, made and signed once: drawing pictures takes longer than all the rest.
static MATCH: LazyLock<Evidence> = LazyLock::new(samples::matching);
static EMBED: LazyLock<Evidence> = LazyLock::new(|| Evidence {
    views: vec![],
    ..samples::embed(true)
});
static SIGNED: LazyLock<Signed> = LazyLock::new(|| {
    let evidence = Evidence {
        views: vec![],
        ..MATCH.clone()
    };
    sign(&evidence, &samples::key()).unwrap()
});

static SIGNED_EVIDENCE: LazyLock<Option<String>> =
    LazyLock::new(|| Evidence::from_json(SIGNED.json.as_bytes()).ok()?.to_json().ok());

#[test]
fn reports_round_trip_but_for_the_bytes_of_pictures() {
    for (name, evidence) in samples::all() {
        let json = evidence.to_json().unwrap();
        let again = Evidence::from_json(json.as_bytes()).unwrap();
        assert_eq!(again.to_json().unwrap(), json, "{name}");
        assert_eq!(again.verification, evidence.verification, "{name}");
        for (a, b) in again.views.iter().zip(&evidence.views) {
            assert!(a.read.png().is_none() && a.read.sha256 == b.read.sha256, "{name}");
        }
        let signed = sign(&evidence, &samples::key()).unwrap().json;
        assert_eq!(Evidence::from_json(signed.as_bytes()).unwrap(), again, "{name}: signed");
    }
}

#[test]
fn the_order_of_fields_is_fixed() {
    let json = samples::matching().to_json().unwrap();
    assert!(
        json.starts_with(
            "{\"schema\":\"guardsplat.evidence\",\"version\":5,\"audience\":\"owner\",\"kind\":\"verify\""
        )
    );
    let place = |field: &str| json.rfind(&format!("\"{field}\":")).unwrap();
    let order = [
        "job",
        "started",
        "engine",
        "model",
        "key",
        "inputs",
        "verification",
        "embedding",
        "views",
    ];
    assert!(order.is_sorted_by_key(|field| place(field)));
    assert!(json.contains("\"started\":\"2026-03-14T09:26:53Z\",\"finished\":\"2026-03-14T09:27:31.5Z\""));
}

proptest! {
    #[test]
    fn numbers_read_back_to_the_last_bit(accuracy in 0.0..=1.0_f64, logit in -1e12..1e12_f64, p in 0.0..1e-20_f64) {
        let mut evidence = EMBED.clone();
        evidence.embedding.as_mut().unwrap().bit_accuracy = accuracy;
        let verification = evidence.verification.as_mut().unwrap();
        verification.strip[0].logit = Some(logit);
        verification.decision.as_mut().unwrap().p_value = p;
        let again = Evidence::from_json(evidence.to_json().unwrap().as_bytes()).unwrap();
        prop_assert_eq!(again, evidence);
    }

    #[test]
    fn any_text_round_trips(text in "\\PC{1,40}", controls in "[\u{0}-\u{1f}\u{2028}\u{202e}]{1,5}") {
        let mut evidence = MATCH.clone();
        evidence.views.clear();
        evidence.inputs[0].name = Some(text);
        evidence.job = controls;
        let again = Evidence::from_json(evidence.to_json().unwrap().as_bytes()).unwrap();
        prop_assert_eq!(again, evidence);
    }

    #[test]
    fn bytes_that_are_no_report_are_refused_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Evidence::from_json(&bytes).is_err());
    }

    #[test]
    fn a_byte_that_was_changed_panics_nowhere(at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        for document in [SIGNED.json.clone(), SIGNED.html.clone()] {
            let mut bytes = document.into_bytes();
            let at = at.index(bytes.len());
            let same = bytes[at] == byte;
            bytes[at] = byte;
            let answer = check(&bytes, &samples::key().verifying_key()).answer;
            let space = at + 1 == bytes.len() && byte.is_ascii_whitespace();
            // Another last digit may be the same number, to the last bit; then the report says what was signed.
            let alike = Evidence::from_json(&bytes).is_ok_and(|read| read.to_json().ok() == *SIGNED_EVIDENCE);
            let genuine = matches!(answer, Answer::Genuine);
            prop_assert!(genuine || !same);
            prop_assert!(!genuine || same || space || alike);
        }
    }
}

#[test]
fn another_version_is_named_before_its_fields_are_looked_at() {
    let json = samples::matching().to_json().unwrap();
    let newer = json.replace("\"version\":5,", "\"version\":6,\"something\":{\"new\":[1,2]},");
    let error = Evidence::from_json(newer.as_bytes()).unwrap_err();
    assert!(matches!(error, Error::UnknownVersion { found: 6, known: 5 }), "{error}");
    assert!(error.to_string().contains("version 6"), "{error}");
    let signed = sign(&samples::matching(), &samples::key())
        .unwrap()
        .json
        .replace("\"version\":5", "\"version\":7");
    let error = Evidence::from_json(signed.as_bytes()).unwrap_err();
    assert!(matches!(error, Error::UnknownVersion { found: 7, .. }), "{error}");
}

#[test]
fn what_is_too_large_is_refused_unread() {
    let error = Evidence::from_json(&vec![b' '; limits::JSON_BYTES + 1]).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }), "{error}");
    let deep = "[".repeat(1 << 20);
    assert!(Evidence::from_json(deep.as_bytes()).is_err());
    let deep = format!("{{\"schema\":\"guardsplat.evidence\",\"version\":1,\"x\":{deep}");
    assert!(Evidence::from_json(deep.as_bytes()).is_err());
}

#[test]
fn values_out_of_range_are_refused_by_name() {
    type Change = fn(&mut Evidence);
    let changes: [(&str, Change); 14] = [
        ("schema", |e| e.schema = "other".into()),
        ("job", |e| e.job.clear()),
        ("key.id", |e| e.key.id = "k".repeat(limits::NAME_BYTES + 1)),
        ("finished", |e| std::mem::swap(&mut e.started, &mut e.finished)),
        ("inputs", |e| e.inputs = vec![e.inputs[0].clone(); limits::INPUTS + 1]),
        ("views", |e| e.views = vec![e.views[0].clone(); limits::VIEWS + 1]),
        ("embedding.ssim", |e| e.embedding.as_mut().unwrap().ssim = f64::NAN),
        ("embedding.psnr_db", |e| {
            e.embedding.as_mut().unwrap().psnr_db = Some(f64::INFINITY)
        }),
        ("embedding.payload", |e| {
            e.embedding.as_mut().unwrap().payload = Some("C0FFEE".into())
        }),
        ("verification.decision.matched", |e| decision(e).matched = 65),
        ("verification.decision.p_value", |e| decision(e).p_value = -1e-9),
        ("verification.decision.hypotheses", |e| decision(e).hypotheses = 0),
        ("verification.strip[3].confidence", |e| {
            e.verification.as_mut().unwrap().strip[3].confidence = Some(1.5)
        }),
        ("verification.strip", |e| {
            e.verification.as_mut().unwrap().strip.truncate(5)
        }),
    ];
    for (field, change) in changes {
        let mut evidence = Evidence {
            views: MATCH.views.clone(),
            ..EMBED.clone()
        };
        change(&mut evidence);
        match evidence.to_json().unwrap_err() {
            Error::BadField { field: found, .. } => assert_eq!(found, field),
            other => panic!("{field}: {other}"),
        }
        assert!(sign(&evidence, &samples::key()).is_err(), "{field}");
    }
}

fn decision(evidence: &mut Evidence) -> &mut guardsplat_evidence::Decision {
    evidence.verification.as_mut().unwrap().decision.as_mut().unwrap()
}

#[test]
fn a_stranger_gets_the_verdict_and_no_secret() {
    let mut evidence = samples::matching();
    evidence.verification.as_mut().unwrap().note = Some("logit 3 is 4.5".into());
    evidence.inputs.push(samples::embed(true).inputs[0].clone());
    let stranger = evidence.for_stranger();
    let [ours, theirs] = [&evidence, &stranger].map(|e| e.verification.as_ref().unwrap());
    assert_eq!(
        (ours.verdict, &ours.decision, &ours.tried, ours.views),
        (theirs.verdict, &theirs.decision, &theirs.tried, theirs.views)
    );
    assert_eq!(theirs.found.as_ref().unwrap().owner, "Atelier Morgenrot");
    let signed = sign(&stranger, &samples::key()).unwrap();
    let hidden = [
        "c0ffee42",
        "logit 3",
        "garden statue.ply",
        &*evidence.views[0].original.as_ref().unwrap().sha256.to_string(),
        &*evidence.views[0].difference.as_ref().unwrap().sha256.to_string(),
    ];
    for document in [&signed.json, &signed.html] {
        for secret in hidden {
            assert!(!document.contains(secret), "{secret}");
        }
        assert!(document.contains("IMG_4711.jpeg"), "what the stranger sent");
    }
    assert!(!signed.html.contains("<svg class=\"strip\""));
    assert!(signed.json.contains("\"strip\":[]"));
    let marking = samples::embed(true).for_stranger().to_json().unwrap();
    assert!(!marking.contains("c0ffee42") && !marking.contains("marked.ply"));
    assert_eq!(stranger.for_stranger(), stranger);
}

/// Signed by version 1.
const REPORTS: [(&str, &[u8]); 5] = [
    ("match", include_bytes!("reports_of_before/match.json")),
    ("no match", include_bytes!("reports_of_before/no-match.json")),
    ("embed", include_bytes!("reports_of_before/embed.json")),
    (
        "inconclusive",
        include_bytes!("reports_of_before/inconclusive-weak.json"),
    ),
    ("page", include_bytes!("reports_of_before/match-stranger.html")),
];

/// Signed by version 3.
const COUNTED: [(&str, &[u8]); 2] = [
    ("match", include_bytes!("reports_of_before/match-version-3.json")),
    ("no match", include_bytes!("reports_of_before/no-match-version-3.json")),
];

/// What a report says that is genuine, and holds.
#[track_caller]
fn genuine(name: &str, document: &[u8]) -> Evidence {
    let checked = check(document, &samples::key().verifying_key());
    assert!(
        matches!(checked.answer, Answer::Genuine) && checked.holds(),
        "{name}: {:#?}",
        checked.findings
    );
    checked.evidence.unwrap()
}

#[test]
fn what_was_signed_when_bits_were_counted_is_genuine_still() {
    for (name, document) in COUNTED {
        let mut evidence = genuine(name, document);
        assert_eq!(
            (evidence.version, decision(&mut evidence).rank_sum),
            (3, None),
            "{name}"
        );
        assert!(evidence.to_html().unwrap().contains("Threshold in bits"), "{name}");
    }
}

#[test]
fn what_was_signed_before_is_genuine_still() {
    for (name, document) in REPORTS {
        let checked = check(document, &samples::key().verifying_key());
        assert!(
            matches!(checked.answer, Answer::Genuine),
            "{name}: {:?}",
            checked.answer
        );
        assert!(checked.holds(), "{name}: {:#?}", checked.findings);
        let evidence = checked.evidence.unwrap();
        assert_eq!((evidence.version, evidence.worker.as_ref()), (1, None), "{name}");
        let read = evidence.verification.as_ref().unwrap();
        assert_eq!((read.tried.paid, read.history.as_ref()), (None, None), "{name}");
    }
}

/// Makes it a decision of before version 4: by the number of the 62 of 64 bits that match.
fn count_matches(decision: &mut Decision, hypotheses: u64) {
    let p_single = chance::tail(64, 62).unwrap();
    *decision = Decision {
        rank_sum: None,
        hypotheses,
        p_single,
        p_value: p_single * hypotheses as f64,
        needed: chance::least_matches(64, decision.threshold, hypotheses).unwrap(),
        ..decision.clone()
    };
}

/// A report as version 2 had it: five readings that pay alike for ten assets.
fn of_version_2() -> Evidence {
    let mut evidence = samples::matching();
    evidence.version = 2;
    let verification = evidence.verification.as_mut().unwrap();
    let framings = &mut verification.tried.framings;
    framings.retain(|group| group.kind != HypothesisKind::Estimated);
    framings.iter_mut().for_each(|group| group.tries = None);
    let decision = verification.decision.as_mut().unwrap();
    count_matches(decision, 5 * 10);
    evidence
}

#[test]
fn readings_of_version_2_pay_alike() {
    let signed = sign(&of_version_2(), &samples::key()).unwrap();
    genuine("version 2", signed.json.as_bytes());
    let refused = |change: fn(&mut HypothesisGroup), evidence: &Evidence| {
        let mut evidence = evidence.clone();
        let framings = &mut evidence.verification.as_mut().unwrap().tried.framings;
        change(&mut framings[0]);
        matches!(evidence.to_json(), Err(Error::BadField { field, .. }) if field == "verification.tried.framings")
    };
    assert!(refused(|group| group.tries = Some(5), &of_version_2()));
    assert!(refused(|group| group.kind = HypothesisKind::Estimated, &of_version_2()));
    assert!(refused(|group| group.tries = None, &samples::matching()));
    assert!(refused(|group| group.tries = Some(0), &samples::matching()));
    assert!(refused(|group| group.pooled = true, &samples::matching()));
}

#[test]
fn ranks_and_leading_pictures_are_of_version_4() {
    let refused = |version: u32, evidence: &Evidence| {
        let evidence = Evidence {
            version,
            ..evidence.clone()
        };
        match evidence.to_json() {
            Err(Error::BadField { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(3, &samples::matching()), "verification.decision.rank_sum");
    let counted = check(COUNTED[0].1, &samples::key().verifying_key()).evidence.unwrap();
    assert_eq!(refused(4, &counted), "verification.decision.rank_sum");
    let mut led = counted;
    led.verification.as_mut().unwrap().tried.framings[1].kind = HypothesisKind::Led;
    assert_eq!(refused(3, &led), "verification.tried.framings");
}

/// Signed by version 4.
#[test]
fn originals_are_of_version_5() {
    let mut evidence = genuine("match", include_bytes!("reports_of_before/match-version-4.json"));
    assert_eq!(evidence.version, 4);
    evidence.verification.as_mut().unwrap().tried.framings[1].kind = HypothesisKind::Registered;
    assert!(matches!(evidence.to_json(), Err(Error::BadField { field, .. }) if field == "verification.tried.framings"));
    evidence.version = 5;
    evidence.to_json().unwrap();
}

#[test]
fn more_than_the_rate_is_not_given() {
    let mut evidence = samples::matching();
    let verification = evidence.verification.as_mut().unwrap();
    verification.tried.framings[1].variants = 2;
    let wrong: Vec<_> = evidence.recompute().into_iter().filter(|f| !f.agrees).collect();
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    assert!(wrong[0].what.contains("than the rate pays for"), "{wrong:?}");
}

#[test]
fn what_a_version_has_can_neither_be_left_out_nor_added() {
    let refused = |change: fn(&mut Evidence)| {
        let mut evidence = samples::matching();
        change(&mut evidence);
        match evidence.to_json() {
            Err(Error::BadField { field, .. }) => field,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(refused(|e| e.version = 1), "worker");
    assert_eq!(
        refused(|e| e.verification.as_mut().unwrap().tried.paid = None),
        "verification.tried.paid"
    );
    assert_eq!(
        refused(|e| e.verification.as_mut().unwrap().history = None),
        "verification.history"
    );
    assert_eq!(refused(|e| e.worker.as_mut().unwrap().attempt = 0), "worker.attempt");
}

#[test]
fn a_match_with_an_asset_that_is_younger_than_its_suspect_does_not_hold() {
    let mut evidence = samples::matching();
    let history = evidence.verification.as_mut().unwrap().history.as_mut().unwrap();
    history.asset.as_mut().unwrap().time = "2026-03-12T18:04:12Z".parse().unwrap();
    let wrong: Vec<_> = evidence.recompute().into_iter().filter(|f| !f.agrees).collect();
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    assert!(wrong[0].what.contains("older than its suspect"), "{wrong:?}");
}
