//! The page of reports: well-formed, nothing but text from texts, and all that a reader needs.
#[path = "../examples/samples/mod.rs"]
mod samples;
mod tree;

use guardsplat_evidence::{Evidence, Reason, sign};
use tree::{Element, Page};

fn page(evidence: &Evidence) -> (String, Page) {
    let html = sign(evidence, &samples::key()).unwrap().html;
    let page = Page::parse(&html);
    (html, page)
}

fn all<'a>(page: &'a Page, selector: &str) -> Vec<Element<'a>> {
    page.select(selector)
}

fn text(page: &Page, selector: &str) -> String {
    let texts = all(page, selector).into_iter().map(|e| e.text());
    texts
        .collect::<String>()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn every_page_is_well_formed_and_accessible() {
    for (name, evidence) in samples::all() {
        let (html, page) = page(&evidence);
        assert_eq!(page.errors, Vec::<&str>::new(), "{name}");
        assert!(html.starts_with("<!DOCTYPE html><html lang=\"en\">"), "{name}");
        assert_eq!(all(&page, "h1").len(), 1, "{name}");
        assert_eq!(all(&page, "main").len(), 1, "{name}");
        let mut level = 1;
        for heading in all(&page, "h1, h2, h3, h4") {
            let next: u32 = heading.name()[1..].parse().unwrap();
            assert!(next <= level + 1, "{name}: h{next} after h{level}");
            level = next;
        }
        for table in all(&page, "table") {
            assert!(!table.select("caption").is_empty(), "{name}");
        }
        for cell in all(&page, "th") {
            assert!(cell.attr("scope").is_some(), "{name}");
        }
        for picture in all(&page, "img") {
            assert!(picture.attr("alt").is_some_and(|alt| alt.len() > 10), "{name}");
        }
        for svg in all(&page, "svg") {
            let hidden = svg.attr("aria-hidden") == Some("true");
            assert!(hidden || svg.attr("aria-labelledby").is_some(), "{name}");
        }
        let mut ids: Vec<_> = all(&page, "[id]").iter().map(|e| e.attr("id").unwrap()).collect();
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count, "{name}: ids are used once");
    }
}

#[test]
fn nothing_comes_from_outside_and_nothing_runs() {
    for (name, evidence) in samples::all() {
        let (_, page) = page(&evidence);
        for element in page.elements() {
            let tag = element.name();
            assert!(
                !["iframe", "object", "embed", "link", "form", "base", "a"].contains(&tag),
                "{name}: {tag}"
            );
            for (attribute, value) in element.attrs() {
                assert!(
                    !attribute.starts_with("on") && attribute != "style",
                    "{name}: {tag} {attribute}"
                );
                let address = ["src", "href", "srcset", "action", "data"].contains(&attribute);
                assert!(
                    !address || value.starts_with("data:image/png;base64,"),
                    "{name}: {tag} {attribute}"
                );
            }
        }
        let scripts = all(&page, "script");
        assert_eq!(scripts.len(), 1, "{name}");
        assert_eq!(scripts[0].attr("type"), Some("application/json"), "{name}");
        let policy = all(&page, "meta[http-equiv='Content-Security-Policy']")[0]
            .attr("content")
            .unwrap();
        assert!(
            policy.starts_with("default-src 'none'; img-src data:; style-src 'sha256-"),
            "{policy}"
        );
        assert!(!policy.contains("unsafe"), "{policy}");
        let style = text(&page, "style");
        assert!(!style.contains("url(") && !style.contains("@import"));
    }
}

#[test]
fn texts_that_mean_harm_stay_texts() {
    let evidence = samples::hostile();
    let (html, page) = page(&evidence);
    assert!(!html.contains("<script>alert"));
    assert!(
        !html.contains('\u{202e}')
            || html
                .split("<script")
                .next()
                .is_some_and(|shown| !shown.contains('\u{202e}'))
    );
    let names = text(&page, ".files th bdi");
    assert!(names.contains("</script><script>alert(1)</script>"), "{names}");
    assert!(
        names.contains("\u{27e8}U+202E\u{27e9}ylp.eman\u{27e8}U+202C\u{27e9} \" onload=\"x\" '&lt;"),
        "{names}"
    );
    assert!(text(&page, "figcaption, h3").contains("\u{27e8}U+200F\u{27e9}"));
    assert!(text(&page, "h1 ~ p").contains("קובץ <b>\u{27e8}U+2066\u{27e9}"));
    // The JSON inside is what programs get, to the letter.
    let inner = Evidence::from_json(text(&page, "script").as_bytes()).unwrap();
    assert_eq!(inner.inputs, evidence.inputs);
    assert_eq!(inner.job, evidence.job);
}

#[test]
fn the_verdict_comes_first_and_says_how_sure_it_is() {
    let (_, found) = page(&samples::matching());
    assert_eq!(text(&found, "h1"), "Match: the message is there");
    let verdict = text(&found, ".verdict");
    assert!(
        verdict.contains("Owner Atelier Morgenrot, asset Garden statue, payload c0ffee42c0ffee42."),
        "{verdict}"
    );
    // The two that differ are the least clear, so 5 words of 2⁶⁴ are as good (no bit, 1, 2, 3 or 1 and 2 wrong): 2.71e-19,
    // half of the rate, times 10 assets: 5.42e-18.
    assert!(
        verdict.contains("62 of 64 bits agree, read from 20 views."),
        "{verdict}"
    );
    assert!(
        verdict.contains("less than one in a hundred quadrillion would agree"),
        "{verdict}"
    );
    let readings = text(&found, ".reading");
    assert!(
        readings.contains("less than one in a hundred quadrillion cases, with all 20 attempts"),
        "{readings}"
    );
    assert!(readings.contains("T = 2,077 of 2,080"), "{readings}");
    assert!(readings.contains("pad is secret and uniform"), "{readings}");
    assert!(readings.contains("p = 5.42 · 10−18"), "{readings}");
    let numbers = text(&found, "table.facts");
    assert!(numbers.contains("Threshold as a rank sum1,788 after"), "{numbers}");
    assert!(text(&found, "section p").contains("2 × 10 × 1 = 20 hypotheses"));
    assert_eq!(all(&found, "rect.cell").len(), 64);
    assert_eq!(all(&found, "rect.differs").len(), 2);
    assert_eq!(all(&found, "path.cross").len(), 2, "seen without colour");
    assert_eq!(
        all(&found, "rect > *, path > *, circle > *").len(),
        0,
        "shapes within shapes are not drawn"
    );
}

#[test]
fn each_verdict_says_what_it_is_and_what_it_is_not() {
    for (name, evidence) in samples::all() {
        let (_, page) = page(&evidence);
        let body = text(&page, "main");
        let heading = text(&page, "h1");
        let wanted = match name {
            "no-match" => ("No match: ", "does not say that the suspect is unmarked"),
            "inconclusive-weak" => ("Inconclusive: ", "more pictures from other directions"),
            "inconclusive-no-message" => ("Inconclusive: ", "reads as some message"),
            "inconclusive-registered-later" => ("Inconclusive: ", "can’t carry its mark"),
            "inconclusive-few-bits" => ("Inconclusive: ", "even all 16 bits would not do"),
            "unknown-key" => ("Unknown key: ", "Nothing was rendered, read or compared"),
            "embed" => ("Marked: ", "at least 36.00 dB"),
            "embed-missed" => ("Marked, below target: ", "What misses the target"),
            _ => ("Match: ", "not who put it there or when"),
        };
        assert!(heading.starts_with(wanted.0), "{name}: {heading}");
        assert!(body.contains(wanted.1), "{name}: {body}");
        assert!(body.contains("What this report does not prove"), "{name}");
        let helps = body.contains("Why, and what would help");
        assert_eq!(
            helps,
            name.starts_with("inconclusive") || name == "unknown-key",
            "{name}"
        );
    }
    let mut evidence = samples::verify(samples::decided(38, guardsplat_evidence::Tried::once()));
    let verification = evidence.verification.as_mut().unwrap();
    verification.verdict = guardsplat_evidence::Verdict::Inconclusive;
    for reason in [Reason::TooManyHypotheses, Reason::TooLittleToRead] {
        evidence.verification.as_mut().unwrap().reason = Some(reason);
        assert!(all(&page(&evidence).1, "h1").len() == 1);
    }
}

#[test]
fn a_page_without_signature_or_pictures_says_so() {
    let evidence = samples::matching();
    let bare = Evidence::from_json(evidence.to_json().unwrap().as_bytes()).unwrap();
    let page = Page::parse(&bare.to_html().unwrap());
    assert!(page.errors.is_empty());
    assert!(text(&page, "main").contains("Nobody signed this report"));
    assert!(all(&page, "img").is_empty());
    assert!(text(&page, "figcaption").contains("not part of this page"));
}

#[test]
fn the_tree_of_these_tests_reads_pages_as_browsers_do() {
    let page = Page::parse(
        "<!DOCTYPE html><title>t</title><h2 id=a>One<!-- no --> &lt;</h2>\
         <div class='x y'><p id=b data-k='v'>two<b id=c>three</b></p></div><p id=d>four</p>",
    );
    assert!(page.errors.is_empty(), "{:?}", page.errors);
    let ids = |selector: &str| {
        let found = page.select(selector);
        found.iter().filter_map(|e| e.attr("id")).collect::<String>()
    };
    for (selector, found) in [
        ("*", "abcd"),
        ("p", "bd"),
        ("b, h2", "ac"),
        ("[id]", "abcd"),
        ("[data-k='v']", "b"),
        ("[data-k='w']", ""),
        (".x *", "bc"),
        ("div.y.x > *", "b"),
        ("div.z > *", ""),
        ("body b", "c"),
        ("body > b", ""),
        ("h2 ~ p", "d"),
        ("p ~ h2", ""),
        ("h2 ~ div > p b", "c"),
    ] {
        assert_eq!(ids(selector), found, "{selector}");
    }
    assert_eq!(text(&page, "body"), "One <twothreefour");
    assert_eq!(page.select("div")[0].select("p, h2").len(), 1);
    // Text among a table's rows goes in front of the table; that and the end tag of nothing are told.
    let bad = Page::parse("<!DOCTYPE html><table>a<tr><td>c</table></i>");
    assert_eq!(text(&bad, "body"), "ac");
    assert!(bad.errors.len() >= 2, "{:?}", bad.errors);
    assert!(!Page::parse("<p>no doctype").errors.is_empty());
    for unknown in [
        "", "p >", "> p", "p > ~ b", "p:hover", "p>b", "p + b", "#a", "[a=v]", "..a",
    ] {
        assert!(
            std::panic::catch_unwind(|| Page::parse("").select(unknown).len()).is_err(),
            "{unknown}"
        );
    }
}
