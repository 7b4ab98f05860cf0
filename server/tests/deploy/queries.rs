//! Queries of the dashboard, of alerts and of the scaler, against the metrics that a server really tells.
use std::collections::BTreeSet;

use guardsplat_server::metrics::Metrics;
use guardsplat_server::run::Readiness;
use serde_json::Value;

use super::{object, read, yaml};

/// Labels that Prometheus adds, and histograms have.
const BESIDES: [&str; 3] = ["job", "instance", "le"];

/// All series that a server can begin with.
fn exported() -> String {
    let metrics = Metrics::default();
    metrics.tally(Some(Default::default()), 0);
    metrics.workers(Some(&[]));
    for (part, well) in Readiness::default().parts() {
        metrics.ready(part, well);
    }
    metrics.text().unwrap()
}

/// Every text called `key` anywhere in a document.
fn texts(value: &Value, key: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            for (name, value) in map {
                match value {
                    Value::String(text) if name == key => found.push(text.clone()),
                    _ => texts(value, key, found),
                }
            }
        }
        Value::Array(list) => list.iter().for_each(|value| texts(value, key, found)),
        _ => {}
    }
}

fn queries() -> Vec<String> {
    let mut found = Vec::new();
    let dashboard: Value = serde_json::from_str(&read("deploy/monitoring/dashboard.json")).unwrap();
    texts(&dashboard, "expr", &mut found);
    assert!(found.len() > 25, "{} queries", found.len());
    let alerts = &yaml("deploy/monitoring/alerts.yaml")[0];
    texts(alerts, "expr", &mut found);
    let scaler = object("ScaledObject", "guardsplat-worker");
    assert_eq!(
        object("Deployment", "guardsplat-worker")["metadata"]["name"],
        scaler["spec"]["scaleTargetRef"]["name"]
    );
    texts(&scaler["spec"]["triggers"], "query", &mut found);
    found
}

fn is_name(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// What stands between `open` and the next `close`, each time.
fn between<'a>(text: &'a str, open: &'a str, close: char) -> impl Iterator<Item = &'a str> {
    text.split(open)
        .skip(1)
        .filter_map(move |rest| rest.split(close).next())
}

#[test]
fn what_is_asked_for_is_what_is_told() {
    let exported = exported();
    let samples = exported.lines().filter(|line| !line.starts_with('#'));
    let names: BTreeSet<&str> = samples
        .clone()
        .filter_map(|line| line.split(['{', ' ']).next())
        .collect();
    let labels: BTreeSet<&str> = samples
        .filter_map(|line| line.split_once('{')?.1.split_once('}'))
        .flat_map(|(labels, _)| labels.split(',').filter_map(|pair| pair.split_once('=')))
        .map(|(label, _)| label)
        .chain(BESIDES)
        .collect();
    let mut used = BTreeSet::new();
    for query in queries() {
        let metrics: Vec<&str> = query
            .split(|c| !is_name(c))
            .filter(|word| word.starts_with("guardsplat_"))
            .collect();
        assert!(!metrics.is_empty(), "{query}");
        for name in &metrics {
            assert!(names.contains(name), "there is no {name}, of {query}");
        }
        used.extend(metrics.into_iter().map(str::to_owned));
        for by in between(&query, "by (", ')') {
            for label in by.split(',').map(str::trim) {
                assert!(labels.contains(label), "there is no label {label}, of {query}");
            }
        }
        for matchers in between(&query, "{", '}') {
            for matcher in matchers.split(',') {
                let label: String = matcher.chars().take_while(|&c| is_name(c)).collect();
                assert!(labels.contains(label.as_str()), "there is no label {label}, of {query}");
                let (how, values) = matcher[label.len()..].split_once('"').unwrap();
                let values = values.trim_end_matches('"');
                // Patterns of methods, and what Grafana or an answer fills in, are nobody's fixed words.
                if how == "=~" && values.contains(['*', '$']) || how == "!~" || label == "code" {
                    continue;
                }
                for value in values.split('|') {
                    let pair = format!("{label}=\"{value}\"");
                    assert!(exported.contains(&pair), "there is no {pair}, of {query}");
                }
            }
        }
        for (open, close) in [('(', ')'), ('[', ']'), ('{', '}')] {
            let count = |wanted| query.chars().filter(|&c| c == wanted).count();
            assert_eq!(count(open), count(close), "{query}");
        }
    }
    // What is measured is looked at: all but the parts of a histogram that no query needs.
    for name in &names {
        let family = ["_bucket", "_sum", "_count"]
            .iter()
            .find_map(|end| name.strip_suffix(end));
        let seen = |name: &str| used.iter().any(|used| used.starts_with(name));
        assert!(seen(family.unwrap_or(name)), "nobody looks at {name}");
    }
    assert!(used.len() > 20, "{used:?}");
}

#[test]
fn metrics_are_documented() {
    let page = read("docs/monitoring.md");
    let exported = exported();
    for line in exported.lines().filter_map(|line| line.strip_prefix("# TYPE ")) {
        let name = line.split(' ').next().unwrap();
        assert!(
            page.contains(&format!("`{name}")),
            "docs/monitoring.md does not tell of {name}"
        );
    }
}
