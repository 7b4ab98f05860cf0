//! Reports in a real browser: nothing is wider than a phone, every text stands out, nothing is fetched, something is seen.
//!
//! Needs Chromium (`CHROMIUM`, or one of its usual names); skipped without it, unless `CI` is set.
mod chromium;
#[path = "../../examples/samples/mod.rs"]
mod samples;

use chromium::{Browser, Scheme};
use guardsplat_evidence::sign;
use std::path::{Path, PathBuf};

/// What the page of a report is asked inside the browser; the script is the wrapper's, since reports run none.
const MEASURE: &str = include_str!("measure.js");

/// All pages as files, by name.
fn pages(folder: &Path) -> Vec<(&'static str, PathBuf)> {
    let write = |(name, evidence)| {
        let path = folder.join(format!("{name}.html"));
        std::fs::write(&path, sign(&evidence, &samples::key()).unwrap().html).unwrap();
        (name, path)
    };
    samples::all().into_iter().map(write).collect()
}

/// A page that shows the others in frames of one width, side by side with what they are called.
fn wrapper(folder: &Path, pages: &[(&str, PathBuf)], width: u32, height: u32, script: &str) -> PathBuf {
    let mut html = String::from(
        "<!DOCTYPE html><meta charset=\"utf-8\"><style>body{margin:0}iframe{border:0;display:block}</style>",
    );
    for (name, path) in pages {
        let page = std::fs::read_to_string(path).unwrap();
        let page = page.replace('&', "&amp;").replace('"', "&quot;");
        html += &format!("<iframe title=\"{name}\" width=\"{width}\" height=\"{height}\" srcdoc=\"{page}\"></iframe>");
    }
    html += &format!("<pre id=\"result\">nothing was measured</pre><script>{script}</script>");
    let path = folder.join(format!("wrapper-{width}.html"));
    std::fs::write(&path, html).unwrap();
    path
}

#[test]
fn pages_fit_a_phone_and_a_screen_and_texts_stand_out() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let pages = pages(folder.path());
    for (width, scheme) in [(360, Scheme::Light), (320, Scheme::Dark), (1280, Scheme::Dark)] {
        let wrapper = wrapper(folder.path(), &pages, width, 800, MEASURE);
        let dom = browser.dom(&wrapper, scheme);
        let (_, rest) = dom.split_once("<pre id=\"result\">").expect("a result");
        let lines: Vec<&str> = rest.split("</pre>").next().unwrap().lines().collect();
        assert_eq!(lines.len(), pages.len(), "{lines:#?}");
        for line in lines {
            // The name, the scheme that the page was drawn in, and what is wrong with it.
            let [name, drawn, problems] = line.splitn(3, '|').collect::<Vec<_>>()[..] else {
                panic!("{line}")
            };
            assert_eq!(drawn, scheme.name(), "{name}");
            assert_eq!(problems, "", "{name} at {width} pixels, {drawn}");
        }
    }
}

#[test]
fn the_measure_finds_what_is_wrong() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.html");
    let html = "<!DOCTYPE html><title>bad</title><body style=\"background:#fff\"><p style=\"width:500px\">wide</p>\
                <p style=\"color:#bbb\">faint</p><img src=\"http://outside.invalid/x.png\">";
    std::fs::write(&bad, html).unwrap();
    let dom = browser.dom(
        &wrapper(folder.path(), &[("bad", bad)], 360, 800, MEASURE),
        Scheme::Light,
    );
    for problem in ["scrolls sideways", "p ends at", "contrast of", "was fetched"] {
        assert!(dom.contains(problem), "{problem}: {dom}");
    }
}

#[test]
fn nothing_is_fetched_and_something_is_seen() {
    let Some(browser) = Browser::find() else { return };
    let folder = tempfile::tempdir().unwrap();
    // That the ear is open: a page that does ask for something from outside.
    let asking = folder.path().join("asking.html");
    std::fs::write(&asking, "<!DOCTYPE html><img src=\"http://outside.invalid/pixel.png\">").unwrap();
    let (_, heard) = browser.screenshot(&asking, Scheme::Light);
    assert!(heard.iter().any(|line| line.contains("outside.invalid")), "{heard:?}");

    for (name, path) in pages(folder.path()) {
        if !["match", "hostile", "embed"].contains(&name) {
            continue;
        }
        let mut means = Vec::new();
        for scheme in [Scheme::Light, Scheme::Dark] {
            let (picture, heard) = browser.screenshot(&path, scheme);
            assert_eq!(heard, Vec::<String>::new(), "{name}: nothing is asked for");
            let (colours, mean) = look(&picture);
            assert!(colours > 20, "{name}: {colours} colours only");
            means.push(mean);
        }
        assert!(
            means[0] > 180.0 && means[1] < 80.0,
            "{name}: light, then dark: {means:?}"
        );
    }
}

/// The number of different colours of a picture, and its mean value, 0 to 255.
fn look(png: &[u8]) -> (usize, f64) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let frame = reader.next_frame(&mut pixels).unwrap();
    let channels = frame.color_type.samples();
    let colours: std::collections::BTreeSet<&[u8]> = pixels.chunks_exact(channels).map(|p| &p[..3]).collect();
    let sum: u64 = pixels.chunks_exact(channels).map(|p| u64::from(p[1])).sum();
    (colours.len(), sum as f64 / (pixels.len() / channels) as f64)
}
