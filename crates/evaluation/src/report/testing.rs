//! Records for the tests of reports.
use super::record::{Claims, Detection, Embedding, Mark, ReadingRecord, Record, Timing};
use super::store::Records;

/// A change of a record, and the field that it is of.
pub type Change<T> = (&'static str, fn(&mut T));

/// A mark whose results are round numbers.
pub fn mark(scene: &str, bits: u32, variant: &str, seed: u64) -> Mark {
    Mark {
        embedding: Embedding {
            scene: scene.into(),
            bits,
            variant: variant.into(),
            settings_hash: format!("settings of {variant}"),
            seed,
            key_seed: 7,
            message: "c0ffee42c0ffee42c0ffee42c0ffee42".into(),
            clip: "ViT-B/16".into(),
            clip_hash: "clip".into(),
            engine_version: "0.1.0".into(),
            size: 400,
        },
        experiment: "capacity".into(),
        gaussians: 1000,
        device: "cpu".into(),
        psnr_db: Some(40.0),
        ssim: 0.99,
        lpips: Some(0.002),
        seconds: 60.0,
        key_seconds: None,
        steps: 1300,
        view_steps: 20_800,
        view_steps_to_99: None,
        decoder_accuracy: Some(1.0),
        peak_memory_bytes: None,
        unmarked_accuracy: Some(0.53),
        difference_picture: None,
        timing: None,
    }
}

/// What was read of a mark, bits right by view; the whole message is right from 1 view if it is in the first.
pub fn reading(mark: &Mark, attack: &str, bits_right: &[u16]) -> ReadingRecord {
    let bits = mark.embedding.bits;
    ReadingRecord {
        mark: mark.id(),
        attack: attack.into(),
        size: mark.embedding.size,
        views: bits_right.len() as u32,
        first_view: 0,
        bits,
        bits_right: bits_right.to_vec(),
        message_right_from: [(1, bits_right.first().is_some_and(|right| u32::from(*right) == bits))].into(),
        psnr_db: None,
        elevation_deg: None,
    }
}

/// A detector that is right about three of four pairs.
pub fn detection(marks: &[Mark]) -> Detection {
    Detection {
        detector: "chi-square".into(),
        scenes: marks.iter().map(|mark| mark.embedding.scene.clone()).collect(),
        marks: marks.iter().map(Mark::id).collect(),
        seed: 1,
        views: None,
        clean: vec![0.1, 0.4],
        marked: vec![0.3, 0.9],
        auc: 0.75,
        auc_interval: [0.2, 0.98],
        clusters: None,
    }
}

/// Two right claims from ten views each, one of which matched, and a thousand wrong ones as p-values have them.
pub fn claims(mark: &Mark, suspect: &str, searched: bool) -> Claims {
    Claims {
        mark: mark.id(),
        suspect: suspect.into(),
        searched,
        size: mark.embedding.size,
        views: 20,
        pool: 10,
        framings: if searched { 144 } else { 1 },
        rate: 1e-6,
        p_values: vec![1e-9, 1e-3],
        payloads: 1,
        wrong: 1000,
        wrong_at_most: [100, 10, 1, 0, 0, 0],
        wrong_as_trials: Some([200, 60, 15, 4, 1, 0]),
    }
}

/// Records as a store would keep them.
pub fn records(all: impl IntoIterator<Item = Record>) -> Records {
    let mut records = Records::default();
    for record in all {
        let id = record.id();
        records.check(&id, &record).unwrap();
        records.insert(id, record);
    }
    records
}

/// When and where a mark of that run was timed.
pub fn timing(run: &str) -> Timing {
    Timing {
        processor: "a processor".into(),
        cores: 4,
        threads: 4,
        run: run.into(),
        began: run.into(),
        load_before: Some(0.1),
        processor_seconds: Some(100.0),
    }
}
