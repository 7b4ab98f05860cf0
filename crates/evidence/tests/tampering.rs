//! Whatever is changed in a signed report is found.
#[path = "../examples/samples/mod.rs"]
mod samples;

use guardsplat_evidence::{Altered, Answer, SigningKey, check, sign};
use serde_json::Value;

fn answer(document: &str) -> Answer {
    check(document.as_bytes(), &samples::key().verifying_key()).answer
}

#[test]
fn what_was_signed_is_genuine_and_its_numbers_follow() {
    for (name, evidence) in samples::all() {
        let signed = sign(&evidence, &samples::key()).unwrap();
        for document in [&signed.json, &signed.html] {
            let checked = check(document.as_bytes(), &samples::key().verifying_key());
            assert!(
                matches!(checked.answer, Answer::Genuine),
                "{name}: {:?}",
                checked.answer
            );
            assert!(checked.holds(), "{name}: {:#?}", checked.findings);
        }
        // A page gives all of it back, pictures included.
        let checked = check(signed.html.as_bytes(), &samples::key().verifying_key());
        assert_eq!(checked.evidence.as_ref(), Some(&evidence), "{name}");
        assert_eq!(
            signed,
            sign(&evidence, &samples::key()).unwrap(),
            "{name}: the same bytes again"
        );
    }
}

#[test]
fn every_value_of_the_json_is_covered() {
    for evidence in [samples::matching(), samples::embed(true)] {
        let json = sign(&evidence, &samples::key()).unwrap().json;
        let document: Value = serde_json::from_str(&json).unwrap();
        let mut places = Vec::new();
        leaves(&document, String::new(), &mut places);
        assert!(places.len() > 100, "{}", places.len());
        for place in places {
            let mut changed = document.clone();
            let leaf = changed.pointer_mut(&place).unwrap();
            *leaf = other(leaf);
            let text = changed.to_string();
            match answer(&text) {
                Answer::Altered(_) => {}
                // What says that it is no report of this version is none.
                Answer::NotAReport(_) => {
                    assert!(["/evidence/schema", "/evidence/version"].contains(&&*place), "{place}")
                }
                other => panic!("{place}: {other:?}"),
            }
        }
    }
}

/// Paths of everything that is neither a list nor an object.
fn leaves(value: &Value, path: String, places: &mut Vec<String>) {
    match value {
        Value::Object(fields) => fields
            .iter()
            .for_each(|(name, v)| leaves(v, format!("{path}/{name}"), places)),
        Value::Array(items) => (0..)
            .zip(items)
            .for_each(|(i, v): (usize, _)| leaves(v, format!("{path}/{i}"), places)),
        _ => places.push(path),
    }
}

/// Another value of the same kind, as legal as can be.
fn other(value: &Value) -> Value {
    match value {
        Value::Null => Value::from(1),
        Value::Bool(b) => Value::from(!b),
        Value::Number(n) if n.is_u64() => Value::from(n.as_u64().unwrap() + 1),
        Value::Number(n) => Value::from(n.as_f64().unwrap() * (1.0 - f64::EPSILON)),
        Value::String(text) => {
            // The last digit of a hash, the last letter of a name, the fraction of a time.
            let (start, end) = text.split_at(text.char_indices().next_back().unwrap().0);
            Value::from(match end {
                "Z" => format!("{start}.25Z").replace(".5.25Z", ".25Z"),
                "0" => format!("{start}1"),
                _ => format!("{start}0"),
            })
        }
        _ => unreachable!("a leaf"),
    }
}

#[test]
fn parts_that_are_left_out_or_added_are_found() {
    let json = sign(&samples::matching(), &samples::key()).unwrap().json;
    let document: Value = serde_json::from_str(&json).unwrap();
    for name in ["job", "verification", "inputs", "views", "key"] {
        let mut changed = document.clone();
        changed["evidence"].as_object_mut().unwrap().remove(name);
        assert!(matches!(answer(&changed.to_string()), Answer::Altered(_)), "{name}");
    }
    for list in ["/evidence/inputs", "/evidence/views", "/evidence/verification/strip"] {
        let mut changed = document.clone();
        changed.pointer_mut(list).unwrap().as_array_mut().unwrap().pop();
        assert!(matches!(answer(&changed.to_string()), Answer::Altered(_)), "{list}");
    }
    let mut changed = document.clone();
    changed["evidence"]["remark"] = "also".into();
    assert!(matches!(
        answer(&changed.to_string()),
        Answer::Altered(Altered::Impossible(_))
    ));
    let twice = json.replacen("\"job\":", "\"job\":\"other\",\"job\":", 1);
    assert!(matches!(answer(&twice), Answer::Altered(_)));
    // Spaces between them change nothing of what the fields say.
    let pretty = serde_json::to_string_pretty(&document).unwrap();
    assert!(matches!(answer(&pretty), Answer::Genuine));
}

#[test]
fn every_part_of_the_page_is_covered() {
    let html = sign(&samples::matching(), &samples::key()).unwrap().html;
    assert!(
        matches!(answer(&format!("{html}\r\n\n")), Answer::Genuine),
        "white space at the end"
    );
    let changes = [
        ("<h1>Match", "<h1>No match"),
        ("Atelier Morgenrot</bdi>", "Atelier Abendrot</bdi>"),
        ("max-width: 52rem", "max-width: 53rem"),
        ("default-src 'none'", "default-src 'self'"),
        ("iVBORw0KGgo", "iVBORw0KGgp"),
        ("</main>", "<p>More</p></main>"),
        ("<!DOCTYPE html>", "<!DOCTYPE html> "),
        ("<!-- page signature", "<p>More</p><!-- page signature"),
        (" -->\n", " --><p>More</p>\n"),
    ];
    for (from, to) in changes {
        assert!(html.contains(from), "{from}");
        let changed = html.replacen(from, to, 1);
        assert!(
            matches!(answer(&changed), Answer::Altered(Altered::Page)),
            "{from}: {:?}",
            answer(&changed)
        );
    }
    let (_, signature) = html.rsplit_once("<!-- page signature").unwrap();
    let unsigned = html.replace(&format!("<!-- page signature{signature}"), "");
    assert!(matches!(answer(&unsigned), Answer::Altered(Altered::Page)));
    // A page of another report of the same service does not lend its signature.
    let other = sign(&samples::embed(true), &samples::key()).unwrap().html;
    let (_, foreign) = other.rsplit_once("<!-- page signature").unwrap();
    assert!(matches!(
        answer(&html.replace(signature, foreign)),
        Answer::Altered(Altered::Page)
    ));
}

#[test]
fn pictures_that_were_exchanged_are_found_by_their_hashes_too() {
    let evidence = samples::matching();
    let html = sign(&evidence, &samples::key()).unwrap().html;
    let other = sign(&samples::embed(true), &samples::key()).unwrap().html;
    let data = |page: &str, i: usize| {
        page.split("src=\"")
            .nth(i)
            .unwrap()
            .split('"')
            .next()
            .unwrap()
            .to_owned()
    };
    let changed = html.replace(&data(&html, 1), &data(&other, 9));
    let checked = check(changed.as_bytes(), &samples::key().verifying_key());
    let finding = checked
        .findings
        .iter()
        .find(|f| f.what.contains("inside the page"))
        .unwrap();
    assert!(!finding.agrees, "{finding:?}");
}

#[test]
fn somebody_elses_signature_is_told_apart_from_a_change() {
    let other = SigningKey::from_bytes(&[8; 32]);
    let signed = sign(&samples::matching(), &other).unwrap();
    for document in [&signed.json, &signed.html] {
        let Answer::WrongKey { signer } = answer(document) else {
            panic!("{:?}", answer(document))
        };
        assert_eq!(signer, other.verifying_key());
    }
    // To claim the service's key is a change, of either document.
    let [ours, theirs] = [samples::key(), other].map(|key| hex::encode(key.verifying_key().as_bytes()));
    assert!(matches!(
        answer(&signed.json.replace(&theirs, &ours)),
        Answer::Altered(_)
    ));
    assert!(matches!(
        answer(&signed.html.replace(&theirs, &ours)),
        Answer::Altered(_)
    ));
}

#[test]
fn what_nobody_signed_or_is_no_report_is_called_that() {
    let evidence = samples::matching();
    assert!(matches!(answer(&evidence.to_json().unwrap()), Answer::Unsigned));
    assert!(matches!(answer(&evidence.to_html().unwrap()), Answer::Unsigned));
    let documents = [
        "",
        "{}",
        "{",
        "[]",
        "<html></html>",
        "{\"schema\":\"other\",\"version\":1}",
        "\u{feff}{}",
    ];
    for document in documents {
        assert!(matches!(answer(document), Answer::NotAReport(_)), "{document}");
    }
    let bytes = check(&[0xff, 0xfe, 0], &samples::key().verifying_key());
    assert!(matches!(bytes.answer, Answer::NotAReport(_)));
}

#[test]
fn numbers_that_do_not_follow_are_found_even_when_they_were_signed() {
    type Change = fn(&mut guardsplat_evidence::Decision);
    let changes: [(&str, Change); 5] = [
        ("p-value", |d| d.p_value *= 1.0 + 1e-6),
        ("p-value of one hypothesis", |d| d.p_single *= 2.0),
        ("hypotheses", |d| d.hypotheses = 1),
        ("needed rank sum", |d| d.needed = Some(50)),
        ("verdict", |d| d.threshold = 1e-20),
    ];
    for (what, change) in changes {
        let mut evidence = samples::matching();
        change(evidence.verification.as_mut().unwrap().decision.as_mut().unwrap());
        let signed = sign(&evidence, &samples::key()).unwrap();
        let checked = check(signed.json.as_bytes(), &samples::key().verifying_key());
        assert!(matches!(checked.answer, Answer::Genuine) && !checked.holds(), "{what}");
        assert!(
            checked.findings.iter().any(|f| f.what == what && !f.agrees),
            "{what}: {:?}",
            checked.findings
        );
    }
    let mut evidence = samples::matching();
    evidence.verification.as_mut().unwrap().strip[0].read ^= true;
    let wrong = |e: &guardsplat_evidence::Evidence| e.recompute().into_iter().find(|f| !f.agrees).map(|f| f.what);
    assert_eq!(wrong(&evidence).as_deref(), Some("matches of the strip"));
    let mut evidence = samples::matching();
    let strip = &mut evidence.verification.as_mut().unwrap().strip;
    strip
        .iter_mut()
        .for_each(|bit| bit.logit = bit.logit.map(|logit| 1.0 / logit));
    assert_eq!(wrong(&evidence).as_deref(), Some("rank sum of the strip"));
    let mut evidence = samples::matching();
    evidence.views[0].difference = evidence.views[1].difference.clone();
    assert_eq!(wrong(&evidence).as_deref(), Some("difference of View 1"));
}
