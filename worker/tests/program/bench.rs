//! `bench`: every job and stage is told, with spreads.
use serde_json::Value;

use super::{Bench, write};

#[test]
fn the_machine_is_measured() {
    let bench = Bench::new();
    write(
        &bench.path("few.json"),
        r#"{"steps": 2, "views_per_step": 2, "fresh_per_step": 1, "early_stop": null,
            "verify": {"views": 1, "message_views": 1}}"#,
    );
    let line = "bench --gaussians 60,200 --presets draft --repetitions 2 --settings few.json --device cpu";
    let told = bench.json(&format!("{line} --json"), 0);
    assert_eq!((&told["device"], &told["repetitions"]), (&"cpu".into(), &2.into()));
    for field in ["version", "processor", "date"] {
        assert!(told[field].as_str().is_some_and(|text| !text.is_empty()), "{field}");
    }
    let scenes = told["scenes"].as_array().unwrap();
    assert_eq!(scenes.len(), 2);
    for scene in scenes {
        let jobs: Vec<&Value> = scene["jobs"].as_array().unwrap().iter().collect();
        let names: Vec<&str> = jobs.iter().map(|job| job["name"].as_str().unwrap()).collect();
        assert_eq!(names, ["embed draft", "verify scene", "verify picture"]);
        for job in &jobs {
            let [median, low, high] = ["median", "p10", "p90"].map(|field| job["seconds"][field].as_f64().unwrap());
            assert!(0.0 < low && low <= median && median <= high, "{job}");
            assert_eq!(job["seconds"]["count"], 2);
        }
        // The picture is of no marked scene, so whatever may have been done to it is undone.
        assert!(jobs[2]["framings"].as_u64().unwrap() > 1, "{}", jobs[2]);
        let steps = &scene["steps"][0];
        assert_eq!(
            (&steps["preset"], &steps["milliseconds"]["count"]),
            (&"draft".into(), &4.into())
        );
        let stages = steps["stages"].as_array().unwrap();
        let sum: f64 = stages.iter().map(|stage| stage[1]["median"].as_f64().unwrap()).sum();
        assert!(stages.len() == 7 && sum > 0.0, "{steps}");
    }
    let text = bench.exits(
        &line.replace("60,200", "60").replace("repetitions 2", "repetitions 1"),
        0,
    );
    assert!(
        text.contains("60 Gaussians") && text.contains("loss and gradient: "),
        "{text}"
    );
    assert!(bench.fails("bench --gaussians 60 --key none.key").contains("none.key"));
}
