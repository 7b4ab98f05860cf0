//! What a detector that has no key makes of clean and marked pictures.
use super::check::{bad, finite, named, share};
use super::id::{Id, Identity};
use crate::error::Result;
use serde::{Deserialize, Serialize};

/// Scores that a detector gave clean and marked pictures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Detection {
    /// The detector, and how it was trained if it was.
    pub detector: String,
    /// The scenes whose pictures were judged.
    pub scenes: Vec<String>,
    /// The marks that were judged, at least one; version, CLIP, bits and variant are theirs.
    pub marks: Vec<Id>,
    /// Seed of the detector and of the choice of pictures.
    pub seed: u64,
    /// Views of each mark that were judged, if that was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub views: Option<u32>,
    /// Scores of clean pictures, at least one; a higher score says "marked".
    pub clean: Vec<f64>,
    /// Scores of marked pictures, at least one.
    pub marked: Vec<f64>,
    /// Area under the ROC curve, 0..=1; 0.5 is guessing.
    pub auc: f64,
    /// 95 % interval of the area, 0..=1.
    pub auc_interval: [f64; 2],
    /// How many scenes the interval is over; `None` if it is over pictures, and so too short.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clusters: Option<u32>,
}

impl Detection {
    /// Its identity; the order of scenes and marks does not matter.
    pub fn id(&self) -> Id {
        detection_id(&self.detector, &self.scenes, &self.marks, self.seed, self.views)
    }

    pub(super) fn check(&self) -> Result<()> {
        named("detector", &self.detector)?;
        if self.marks.is_empty() {
            return bad("marks", "none were judged");
        }
        if self.clean.is_empty() || self.marked.is_empty() {
            return bad(
                "clean",
                format!("{} clean and {} marked scores", self.clean.len(), self.marked.len()),
            );
        }
        for score in self.clean.iter().chain(&self.marked) {
            finite("scores", *score)?;
        }
        let [low, high] = self.auc_interval;
        if self.views == Some(0) || self.clusters.is_some_and(|clusters| clusters < 2) {
            return bad(
                "clusters",
                format!("{:?} scenes, {:?} views", self.clusters, self.views),
            );
        }
        share("auc", self.auc)?;
        share("auc_interval", low)?;
        share("auc_interval", high)?;
        if !(low <= self.auc && self.auc <= high) {
            return bad("auc_interval", format!("{} is not within {low}..={high}", self.auc));
        }
        Ok(())
    }
}

/// The identity of a detection; known before it is made.
pub fn detection_id(detector: &str, scenes: &[String], marks: &[Id], seed: u64, views: Option<u32>) -> Id {
    let mut scenes: Vec<&str> = scenes.iter().map(String::as_str).collect();
    let mut marks: Vec<&str> = marks.iter().map(Id::as_str).collect();
    scenes.sort_unstable();
    marks.sort_unstable();
    let identity = Identity::of("detection")
        .text(detector)
        .texts(scenes.into_iter())
        .texts(marks.into_iter())
        .number(seed);
    match views {
        Some(views) => identity.number(views.into()).id(),
        None => identity.id(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{Change, detection, mark};

    #[test]
    fn order_does_not_identify_but_seeds_do() {
        let marks = [mark("lego", 16, "standard", 1), mark("ship", 16, "standard", 1)];
        let first = detection(&marks);
        let mut other = first.clone();
        other.marks.reverse();
        other.clean = vec![0.0];
        assert_eq!(first.id(), other.id());
        other.seed += 1;
        assert_ne!(first.id(), other.id());
        let mut more = first.clone();
        more.views = Some(20);
        assert_ne!(first.id(), more.id());
    }

    #[test]
    fn impossible_detections_are_refused() {
        let marks = [mark("lego", 16, "standard", 1)];
        detection(&marks).check().unwrap();
        let changes: [Change<Detection>; 6] = [
            ("marks", |d| d.marks.clear()),
            ("clean", |d| d.clean.clear()),
            ("scores", |d| d.marked.push(f64::INFINITY)),
            ("clusters", |d| d.clusters = Some(1)),
            ("auc", |d| d.auc = 1.5),
            ("auc_interval", |d| d.auc_interval = [0.9, 0.1]),
        ];
        for (field, change) in changes {
            let mut broken = detection(&marks);
            change(&mut broken);
            let reason = broken.check().unwrap_err().to_string();
            assert!(reason.starts_with(field), "{field}: {reason}");
        }
    }
}
