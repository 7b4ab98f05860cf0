//! `evaluate`: marks and readings are kept, not made twice, and told in reports.
use guardsplat_tests::Bench;
use serde_json::Value;

/// Few steps and small views; how good the marks are is not tested here.
const SETTINGS: &str = r#"{"steps": 2, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null, "size": 32}"#;
const EVALUATE: &str = "evaluate results --scenes one.ply two.ply --experiments capacity,pruning,formats --bits 16,32 \
    --seeds 1 --settings hasty.json --size 48 --views 3 --device cpu";

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("hasty.json", SETTINGS);
    bench.exits("sample one.ply --gaussians 400 --sh-degree 1 --seed 1", 0);
    bench.exits("sample two.ply --gaussians 400 --sh-degree 0 --seed 2", 0);
    bench
}

fn records(bench: &Bench) -> Vec<Value> {
    let text = String::from_utf8(bench.read("results/results.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn results_are_kept_and_what_is_there_is_not_done_again() {
    let bench = bench();
    bench.exits(EVALUATE, 0);
    let first = records(&bench);
    // Two scenes, 16 and 32 bits; nothing done, two prunings, degree 0 and five formats at 32 bits only.
    assert_eq!(first.len(), 2 * (2 + 1 + 1 + 2 + 6));
    let text = String::from_utf8(bench.read("results/results.jsonl")).unwrap();
    for attack in ["prune-lowest:0.25", "format:spz", "format:sog", "sh-degree:0"] {
        assert_eq!(text.matches(attack).count(), 2, "{attack}");
    }

    // Cut off in the middle of a line, as a crash does: that reading alone is made again, to the same bytes.
    let whole = bench.read("results/results.jsonl");
    bench.write("results/results.jsonl", &whole[..whole.len() - 40]);
    bench.exits(EVALUATE, 0);
    assert_eq!(bench.read("results/results.jsonl"), whole);
}

#[test]
fn reports_tell_what_was_measured_and_what_was_not() {
    let bench = bench();
    bench.write("page.md", "# Page\n\n<!-- BEGIN capacity -->\n<!-- END capacity -->\n");
    bench.exits(
        "evaluate results --scenes one.ply --bits 16 --seeds 1 --settings hasty.json --size 48 --views 2 --device cpu \
         --document page.md",
        0,
    );
    let page = String::from_utf8(bench.read("page.md")).unwrap();
    let html = String::from_utf8(bench.read("results/report.html")).unwrap();
    for text in [&page, &html] {
        assert!(text.contains("one.ply") && text.contains("not measured"), "{text}");
    }
    assert!(html.contains("<svg") && html.contains("data:image/png;base64,"));
    assert!(!html.contains("src=\"http"));
    let report: Value = serde_json::from_slice(&bench.read("results/report.json")).unwrap();
    assert_eq!(report[0]["name"], "capacity");
    let readings = String::from_utf8(bench.read("results/readings.csv")).unwrap();
    assert_eq!(readings.lines().count(), 2); // a head and one reading
    // Without anything new, the same report.
    bench.exits("evaluate results --report-only", 0);
    assert_eq!(String::from_utf8(bench.read("results/report.html")).unwrap(), html);
}

#[test]
fn what_cannot_be_evaluated_is_refused() {
    let bench = bench();
    bench.refuses("evaluate results --device cpu", &["scenes", "at least one"]);
    bench.refuses("evaluate results --scenes no.ply --device cpu --bits 16", &["no.ply"]);
    bench.refuses(
        "evaluate results --experiments magic --scenes one.ply",
        &["magic", "capacity"],
    );
    bench.refuses("evaluate results --report-only", &["results", "no folder"]);
    std::fs::create_dir(bench.path("results")).unwrap();
    bench.write("results/results.jsonl", "nonsense\n");
    bench.refuses("evaluate results --report-only", &["results.jsonl", "line 1"]);
}
