//! Reads every query in files of Grafana, Prometheus and KEDA as Prometheus would, and names those that it would refuse.
//!
//! That what they ask for is what a server tells is for `server/tests/deploy/queries.rs`.
use std::process::ExitCode;

use serde_json::Value;

/// What queries are called: by Grafana and Prometheus, and by KEDA.
const KEYS: [&str; 2] = ["expr", "query"];
/// What Grafana fills in where Prometheus wants a length of time.
const FILLED_IN: [&str; 2] = ["$__rate_interval", "$__range"];

fn main() -> ExitCode {
    let mut failed = false;
    for path in std::env::args().skip(1) {
        match check(&path) {
            Ok(count) => println!("{path}: {count} queries"),
            Err(problems) => {
                failed = true;
                for problem in problems {
                    eprintln!("{path}: {problem}");
                }
            }
        }
    }
    ExitCode::from(u8::from(failed))
}

/// How many queries a file has, or what is wrong with them. One without any is no file to be checked.
fn check(path: &str) -> Result<usize, Vec<String>> {
    let alone = |problem: String| vec![problem];
    let text = std::fs::read_to_string(path).map_err(|error| alone(error.to_string()))?;
    // JSON is YAML.
    let documents: Vec<Value> = serde_saphyr::from_multiple(&text).map_err(|error| alone(error.to_string()))?;
    let mut queries = Vec::new();
    for document in &documents {
        find(document, &mut queries);
    }
    let problems: Vec<String> = queries.iter().filter_map(|query| problem(query)).collect();
    match (queries.len(), problems.is_empty()) {
        (0, _) => Err(alone("has no queries".into())),
        (count, true) => Ok(count),
        (_, false) => Err(problems),
    }
}

/// Every query in a document. What Grafana asks for its own variables is none.
fn find(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                match value {
                    _ if key == "templating" => {}
                    Value::String(text) if KEYS.contains(&key.as_str()) => found.push(text.clone()),
                    _ => find(value, found),
                }
            }
        }
        Value::Array(list) => list.iter().for_each(|value| find(value, found)),
        _ => {}
    }
}

/// Why Prometheus would refuse a query.
fn problem(query: &str) -> Option<String> {
    let asked = FILLED_IN
        .iter()
        .fold(query.to_owned(), |text, variable| text.replace(variable, "5m"));
    let refusal = promql_parser::parser::parse(&asked).err()?;
    Some(format!("{query}: {refusal}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_prometheus_would_refuse_is_named() {
        for fine in [
            "sum by (kind) (rate(jobs_total{job=~\"$job\"}[$__rate_interval]))",
            "histogram_quantile(0.9, sum by (le) (rate(call_seconds_bucket[5m]))) > 2 and up == 1",
        ] {
            assert_eq!(problem(fine), None);
        }
        for wrong in [
            "",
            "sum by kind (rate(jobs_total[5m]))",
            "sum(rate(jobs_total[5m])",
            "rate(jobs_total)",
            "rated(jobs_total[5m])",
            "jobs_total{kind=embed}",
            "jobs_total{kind=~\"(\"}",
            "histogram_quantile(sum by (le) (rate(call_seconds_bucket[5m])), 0.9)",
        ] {
            assert!(problem(wrong).is_some(), "{wrong}");
        }
    }

    #[test]
    fn queries_are_found_wherever_they_stand() {
        let document = serde_json::json!({
            "panels": [{"targets": [{"expr": "a"}], "panels": [{"targets": [{"expr": "b"}]}]}],
            "metadata": {"query": "c"},
            "templating": {"list": [{"query": "label_values(a, job)"}]},
        });
        let mut found = Vec::new();
        find(&document, &mut found);
        found.sort();
        assert_eq!(found, ["a", "b", "c"]);
    }
}
