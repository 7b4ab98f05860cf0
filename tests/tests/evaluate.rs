//! `evaluate`: marks and readings are kept, not made twice, and told in reports.
use guardsplat_tests::TestEnvironment;
use serde_json::Value;

/// Few steps and small views; how good the marks are is not tested here.
const SETTINGS: &str = r#"{"steps": 2, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null, "size": 32}"#;
const EVALUATE: &str = "evaluate results --scenes one.ply two.ply --experiments capacity,pruning,formats --bits 16,32 \
    --seeds 1 --settings hasty.json --size 48 --views 3 --device cpu";

fn environment() -> TestEnvironment {
    let environment = TestEnvironment::new();
    environment.write("hasty.json", SETTINGS);
    environment.exits("sample one.ply --gaussians 400 --sh-degree 1 --seed 1", 0);
    environment.exits("sample two.ply --gaussians 400 --sh-degree 0 --seed 2", 0);
    environment
}

fn records(environment: &TestEnvironment) -> Vec<Value> {
    let text = String::from_utf8(environment.read("results/results.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn results_are_kept_and_what_is_there_is_not_done_again() {
    let environment = environment();
    environment.exits(EVALUATE, 0);
    let first = records(&environment);
    // Two scenes, 16 and 32 bits; nothing done, two prunings, degree 0 and five formats at 32 bits only.
    assert_eq!(first.len(), 2 * (2 + 1 + 1 + 2 + 6));
    let text = String::from_utf8(environment.read("results/results.jsonl")).unwrap();
    for attack in ["prune-lowest:0.25", "format:spz", "format:sog", "sh-degree:0"] {
        assert_eq!(text.matches(attack).count(), 2, "{attack}");
    }

    // Cut off in the middle of a line, as a crash does: that reading alone is made again, to the same bytes.
    let whole = environment.read("results/results.jsonl");
    environment.write("results/results.jsonl", &whole[..whole.len() - 40]);
    environment.exits(EVALUATE, 0);
    assert_eq!(environment.read("results/results.jsonl"), whole);
}

#[test]
fn reports_tell_what_was_measured_and_what_was_not() {
    let environment = environment();
    environment.write("page.md", "# Page\n\n<!-- BEGIN capacity -->\n<!-- END capacity -->\n");
    environment.exits(
        "evaluate results --scenes one.ply --bits 16 --seeds 1 --settings hasty.json --size 48 --views 2 --device cpu \
         --document page.md",
        0,
    );
    let page = String::from_utf8(environment.read("page.md")).unwrap();
    let html = String::from_utf8(environment.read("results/report.html")).unwrap();
    for text in [&page, &html] {
        assert!(text.contains("one.ply") && text.contains("not measured"), "{text}");
    }
    assert!(html.contains("<svg") && html.contains("data:image/png;base64,"));
    assert!(!html.contains("src=\"http"));
    let report: Value = serde_json::from_slice(&environment.read("results/report.json")).unwrap();
    assert_eq!(report[0]["name"], "capacity");
    let readings = String::from_utf8(environment.read("results/readings.csv")).unwrap();
    assert_eq!(readings.lines().count(), 2); // a head and one reading
    // Without anything new, the same report.
    environment.exits("evaluate results --report-only", 0);
    assert_eq!(
        String::from_utf8(environment.read("results/report.html")).unwrap(),
        html
    );
}

/// Random weights of the learned codec: as many as the published ones, and as small as those of a network.
fn codec() -> Vec<u8> {
    const N: usize = 128;
    const M: usize = 192;
    let mut tensors = vec![("entropy_bottleneck.quantiles".to_string(), vec![M, 1, 3])];
    for (name, channels) in [("g_a", [3, N, N, N, M]), ("g_s", [M, N, N, N, 3])] {
        for (i, pair) in channels.windows(2).enumerate() {
            let (inputs, outputs) = (pair[0], pair[1]);
            let kernel = if name == "g_a" {
                [outputs, inputs]
            } else {
                [inputs, outputs]
            };
            let at = 2 * i;
            tensors.push((format!("{name}.{at}.weight"), vec![kernel[0], kernel[1], 5, 5]));
            tensors.push((format!("{name}.{at}.bias"), vec![outputs]));
            if i < 3 {
                tensors.push((format!("{name}.{}.beta", at + 1), vec![outputs]));
                tensors.push((format!("{name}.{}.gamma", at + 1), vec![outputs, outputs]));
            }
        }
    }
    let (mut header, mut values) = (serde_json::Map::new(), Vec::new());
    let mut state = 1_u32;
    for (name, shape) in tensors {
        let start = values.len();
        for _ in 0..shape.iter().product() {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let unit = (state >> 8) as f32 / (1 << 24) as f32;
            values.extend((0.1 * (unit - 0.4)).to_le_bytes());
        }
        let entry = serde_json::json!({"dtype": "F32", "shape": shape, "data_offsets": [start, values.len()]});
        header.insert(name, entry);
    }
    let header = Value::Object(header).to_string();
    [&(header.len() as u64).to_le_bytes(), header.as_bytes(), &values].concat()
}

#[test]
fn the_learned_codec_attacks_where_its_weights_are_given() {
    let environment = environment();
    let line = "evaluate results --scenes one.ply --experiments robustness --attacks none,vae:3 --bits 16 --seeds 1 \
        --settings hasty.json --size 32 --views 2 --device cpu";
    let missing = || {
        let report: Value = serde_json::from_slice(&environment.read("results/report.json")).unwrap();
        report[0]["missing"].to_string()
    };
    environment.exits(line, 0);
    let before = records(&environment).len();
    assert!(missing().contains("vae:3: not measured: no weights"), "{}", missing());

    environment.write("codec.safetensors", codec());
    environment.exits(&format!("{line} --vae codec.safetensors"), 0);
    let records = records(&environment);
    assert_eq!(records.len(), before + 1);
    let reading = records[before].to_string();
    assert!(reading.contains("vae:3"), "{reading}");
    assert!(!missing().contains("no weights"), "{}", missing());

    environment.write("codec.safetensors", &codec()[..9000]);
    environment.refuses(&format!("{line} --vae codec.safetensors"), &["vae", "safetensors"]);
    environment.refuses(&format!("{line} --vae none"), &["none"]);
}

const ROBUSTNESS: &str = "evaluate results --scenes one.ply --experiments robustness --bits 16,32 --seeds 1 \
    --settings hasty.json --size 48 --views 5 --device cpu --attacks jpeg-turbo:30";

#[test]
fn the_robustness_table_is_read_from_other_views_and_goes_on_where_it_was() {
    let environment = environment();
    environment.write("page.md", "<!-- BEGIN robustness -->\n<!-- END robustness -->\n");
    let line = format!("{ROBUSTNESS} --document page.md");
    environment.exits(&line, 0);
    let whole = environment.read("results/results.jsonl");
    let all = records(&environment);
    let of = |kind: &str| -> Vec<&Value> {
        let records = all.iter().map(|line| &line["record"][kind]);
        records.filter(|record| !record.is_null()).collect()
    };
    let marks: Vec<(&Value, &Value)> = of("mark")
        .iter()
        .map(|mark| (&mark["embedding"]["variant"], &mark["embedding"]["bits"]))
        .collect();
    assert_eq!(
        marks,
        [(&"standard".into(), &32.into()), (&"robust".into(), &16.into())]
    );
    let readings = of("reading");
    assert_eq!(readings.len(), 2);
    // The views of the verification come first.
    assert!(readings.iter().all(|reading| reading["first_view"] == 20));
    // 16 bits can make no claim.
    let claims = of("claims");
    assert_eq!(claims.len(), 1);
    assert!(
        claims
            .iter()
            .all(|claim| claim["pool"] == 5 && claim["p_values"].as_array().unwrap().len() == 1)
    );

    let table = String::from_utf8(environment.read("results/robustness.csv")).unwrap();
    // A head, and for either mark one attack, over all scenes and of one.
    assert_eq!(table.lines().count(), 1 + 2 * 2, "{table}");
    let page = String::from_utf8(environment.read("page.md")).unwrap();
    for text in [
        "| JPEG 30 | jpeg-turbo:30 | 1 |",
        "bar 93.0",
        "64 bits, standard: not measured",
    ] {
        assert!(page.contains(text), "{text}: {page}");
    }

    environment.write("results/results.jsonl", &whole[..whole.len() - 40]);
    environment.exits(&line, 0);
    assert_eq!(environment.read("results/results.jsonl"), whole);
}

const SECURITY: &str = "evaluate results --scenes one.ply two.ply --experiments security --bits 16 --seeds 1 \
    --settings hasty.json --size 48 --views 8 --device cpu";

/// Detectors and areas of a folder's detections, in order.
fn areas(environment: &TestEnvironment) -> Vec<(String, f64)> {
    let detections = records(environment)
        .into_iter()
        .map(|line| line["record"]["detection"].clone());
    let detections = detections.filter(|detection| !detection.is_null());
    detections
        .map(|one| (one["detector"].as_str().unwrap().into(), one["auc"].as_f64().unwrap()))
        .collect()
}

#[test]
fn detectors_judge_marks_once_and_find_replaced_bits() {
    let environment = environment();
    environment.exits(SECURITY, 0);
    let areas = areas(&environment);
    let names: Vec<&str> = areas.iter().map(|(name, _)| name.as_str()).collect();
    let detectors = [
        "rs-analysis",
        "sample-pairs",
        "chi-square",
        "primary-sets",
        "fusion",
        "learned",
    ];
    assert_eq!(names[..6], detectors);
    assert_eq!(names[6..], detectors.map(|name| format!("control:{name}")));
    for (name, area) in &areas {
        // Scattered bits escape the chi-square attack.
        let fires = name.starts_with("control:") && !name.ends_with("chi-square");
        assert!((0.0..=1.0).contains(area) && (!fires || *area > 0.9), "{name}: {area}");
    }
    let whole = environment.read("results/results.jsonl");
    let detection = &records(&environment)[4]["record"]["detection"];
    assert_eq!(detection["clean"].as_array().unwrap().len(), 16);
    assert_eq!((&detection["views"], &detection["clusters"]), (&8.into(), &2.into()));
    environment.exits(SECURITY, 0);
    assert_eq!(environment.read("results/results.jsonl"), whole);
    // The last two are lost: they alone are made again, to the same bytes.
    let lines: Vec<&[u8]> = whole.split_inclusive(|byte| *byte == b'\n').collect();
    environment.write("results/results.jsonl", lines[..lines.len() - 2].concat());
    environment.exits(SECURITY, 0);
    assert_eq!(environment.read("results/results.jsonl"), whole);
    let report: Value = serde_json::from_slice(&environment.read("results/report.json")).unwrap();
    assert_eq!(report[0]["missing"], serde_json::json!([]));
    let html = String::from_utf8(environment.read("results/report.html")).unwrap();
    assert!(html.contains("Positive control"));
}

#[test]
fn one_scene_has_no_learned_detector_and_the_report_says_so() {
    let environment = environment();
    environment.exits(&SECURITY.replace(" two.ply", ""), 0);
    let areas = areas(&environment);
    assert_eq!(areas.len(), 10);
    assert!(areas.iter().all(|(name, _)| !name.ends_with("learned")));
    let report: Value = serde_json::from_slice(&environment.read("results/report.json")).unwrap();
    let missing = report[0]["missing"][0].as_str().unwrap();
    assert!(missing.contains("learned: not measured; it judges"), "{missing}");
}

const TRADE: &str = "evaluate results --scenes one.ply --experiments trade --bits 16 --seeds 1 \
    --settings hasty.json --size 48 --views 1 --device cpu --variants own.json --only base,one-step";

#[test]
fn variants_are_timed_once_and_plotted() {
    let environment = environment();
    environment.write("own.json", r#"[{"name": "one-step", "settings": {"steps": 1}}]"#);
    environment.write("page.md", "<!-- BEGIN trade -->\n<!-- END trade -->\n");
    environment.exits(&format!("{TRADE} --document page.md --plot trade.svg"), 0);
    let marks: Vec<Value> = records(&environment)
        .into_iter()
        .map(|line| line["record"]["mark"].clone())
        .filter(|mark| !mark.is_null())
        .collect();
    let names: Vec<&str> = marks
        .iter()
        .map(|m| m["embedding"]["variant"].as_str().unwrap())
        .collect();
    let expected = ["trade:cpu:base", "trade:cpu:one-step"];
    assert_eq!(names, expected);
    for mark in &marks {
        let timing = &mark["timing"];
        assert!(
            timing["threads"].as_u64().unwrap() > 0 && timing["processor"].is_string(),
            "{timing}"
        );
        assert_eq!(timing["run"], marks[0]["timing"]["run"]);
    }
    assert_eq!((&marks[1]["steps"], &marks[0]["steps"]), (&1.into(), &2.into()));
    let page = String::from_utf8(environment.read("page.md")).unwrap();
    for text in [
        "| one-step |",
        "times base",
        "On the front",
        "Shared pictures",
        "Timed from",
    ] {
        assert!(page.contains(text), "{text}: {page}");
    }
    let plot = String::from_utf8(environment.read("trade.svg")).unwrap();
    assert!(plot.starts_with("<svg") && plot.contains("prefers-color-scheme"));
    assert_eq!(plot.matches("<circle").count() - plot.matches("r=\"8\"").count(), 2);

    // Nothing is timed twice; what is new is.
    let whole = environment.read("results/results.jsonl");
    environment.exits(TRADE, 0);
    assert_eq!(environment.read("results/results.jsonl"), whole);
    let own = r#"[{"name": "one-step", "settings": {"steps": 1}}, {"name": "new", "settings": {"steps": 1}}]"#;
    environment.write("own.json", own);
    environment.exits(&format!("{TRADE},new --document page.md"), 0);
    // Three variants: a mark, its pictures as they are, and shared in five ways.
    assert_eq!(records(&environment).len(), (2 + 1) * (1 + 1 + 5));
    let page = String::from_utf8(environment.read("page.md")).unwrap();
    assert!(page.contains("| new |"), "{page}");
}

#[test]
fn what_cannot_be_evaluated_is_refused() {
    let environment = environment();
    environment.refuses("evaluate results --device cpu", &["scenes", "at least one"]);
    environment.refuses("evaluate results --scenes no.ply --device cpu --bits 16", &["no.ply"]);
    environment.refuses(
        "evaluate results --experiments magic --scenes one.ply",
        &["magic", "capacity"],
    );
    let robustness = "evaluate results --experiments robustness --device cpu --scenes one.ply";
    environment.refuses(&format!("{robustness} --attacks jpeg:0"), &["jpeg", "1 to 100"]);
    environment.refuses(
        "evaluate results --device cpu --scenes one.ply --attacks none",
        &["attacks", "robustness"],
    );
    let trade = "evaluate results --experiments trade --device cpu --scenes one.ply";
    environment.refuses(&format!("{trade} --only magic"), &["magic", "draft", "half-weights"]);
    environment.refuses(&format!("{trade} --variants no.json"), &["no.json"]);
    let plot = "evaluate results --scenes one.ply --device cpu --plot a.svg";
    environment.refuses(plot, &["plot", "trade"]);
    environment.refuses("evaluate results --report-only", &["results", "no folder"]);
    std::fs::create_dir(environment.path("results")).unwrap();
    environment.write("results/results.jsonl", "nonsense\n");
    environment.refuses("evaluate results --report-only", &["results.jsonl", "line 1"]);
}
