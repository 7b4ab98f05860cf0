//! Between the API's messages and the engine's types.
use std::time::Duration;

use guardsplat_codeword::{Hypothesis, PhotometricCorrection, RegisteredTones, Tone, Verdict};
use guardsplat_distortion::{DistortionKind, RobustTo};
use guardsplat_engine::Error as EngineError;
use guardsplat_engine::embed::{self, Outcome, Preset, Settings};
use guardsplat_engine::extract::{DEFAULT_VIEWS, PooledLogits};
use guardsplat_engine::message::Key;
use guardsplat_engine::message::key::KeyProgress;
use guardsplat_engine::message::training::Progress as Training;
use guardsplat_engine::scene::{BadRows, Ignored};
use guardsplat_engine::view::SceneKind;
use guardsplat_proto::v1::embed_spec::{Distortion, Preset as ApiPreset, SceneKind as ApiKind};
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::verify_result::Verdict as ApiVerdict;
use guardsplat_proto::v1::{self as api};

use super::error::{Error, Result};
use guardsplat_operations::embed_settings::chosen;
use guardsplat_operations::verification::Views;
use guardsplat_operations::verification_report::VerificationReport;

/// What is behind scenes, and behind pictures with transparent pixels.
const WHITE: [f32; 3] = [1.0; 3];

/// The settings that an embedding asks for.
pub fn settings(spec: &api::EmbedSpec) -> Result<Settings> {
    let preset = match ApiPreset::try_from(spec.preset) {
        Ok(ApiPreset::Unspecified | ApiPreset::Standard) => Preset::Standard,
        Ok(ApiPreset::Draft) => Preset::Draft,
        Ok(ApiPreset::Robust) => Preset::Robust,
        Ok(ApiPreset::Thorough) => Preset::Thorough,
        Ok(ApiPreset::Paper) => Preset::Paper,
        Err(_) => return Err(Error::BadJob(format!("preset: {} is none", spec.preset))),
    };
    let size = Some(spec.size).filter(|size| *size > 0);
    let mut settings = preset.settings();
    if !spec.robust_to.is_empty() {
        settings.robust_to = robust_to(&spec.robust_to)?;
    }
    settings.kind = kind(spec.scene_kind)?;
    Ok(chosen(settings, spec.seed, size)?)
}

/// The kind of scene, where one is named.
fn kind(number: i32) -> Result<Option<SceneKind>> {
    match ApiKind::try_from(number) {
        Ok(ApiKind::Unspecified) => Ok(None),
        Ok(ApiKind::Object) => Ok(Some(SceneKind::Object)),
        Ok(ApiKind::Room) => Ok(Some(SceneKind::Room)),
        Ok(ApiKind::Terrain) => Ok(Some(SceneKind::Terrain)),
        Ok(ApiKind::Forward) => Ok(Some(SceneKind::Forward)),
        Ok(ApiKind::Unbounded) => Ok(Some(SceneKind::Unbounded)),
        Err(_) => Err(Error::BadJob(format!("scene_kind: {number} is none"))),
    }
}

/// What a mark is to stand.
fn robust_to(numbers: &[i32]) -> Result<RobustTo> {
    let kind = |number: &i32| {
        Ok(match Distortion::try_from(*number) {
            Ok(Distortion::Crop) => DistortionKind::Crop,
            Ok(Distortion::Scaling) => DistortionKind::Scaling,
            Ok(Distortion::Rotation) => DistortionKind::Rotation,
            Ok(Distortion::Brightness) => DistortionKind::Brightness,
            Ok(Distortion::Contrast) => DistortionKind::Contrast,
            Ok(Distortion::Jpeg) => DistortionKind::Jpeg,
            Ok(Distortion::Noise) => DistortionKind::Noise,
            Ok(Distortion::Blur) => DistortionKind::Blur,
            Ok(Distortion::Mask) => DistortionKind::Mask,
            Ok(Distortion::EightBit) => DistortionKind::EightBit,
            Ok(Distortion::Combined) => DistortionKind::Combined,
            Ok(Distortion::ShNoise) => DistortionKind::ShNoise,
            Ok(Distortion::ShTruncation) => DistortionKind::ShTruncation,
            Ok(Distortion::Spz) => DistortionKind::Spz,
            Ok(Distortion::Sog) => DistortionKind::Sog,
            Ok(Distortion::Pruning) => DistortionKind::Pruning,
            Ok(Distortion::Unspecified) | Err(_) => {
                return Err(Error::BadJob(format!("robust_to: {number} is no distortion")));
            }
        })
    };
    numbers.iter().map(kind).collect()
}

/// The views that a verification asks for, without its cameras.
pub fn views(spec: &api::VerifySpec) -> Result<Views> {
    let within = |field: &str, value: u32, low: u32, high: u32| match value {
        0 => Ok(None),
        value if (low..=high).contains(&value) => Ok(Some(value)),
        value => Err(Error::BadJob(format!("{field}: {value} is outside {low} to {high}"))),
    };
    Ok(Views {
        count: within("views", spec.views, 1, 10_000)?.map_or(DEFAULT_VIEWS, |views| views as usize),
        size: within("size", spec.size, 16, 4096)?,
        background: WHITE,
        seed: spec.seed,
        cameras: Vec::new(),
        kind: kind(spec.scene_kind)?,
        bad_rows: BadRows::ignored_if(spec.ignore_bad_rows),
        with_files: false,
        level: 0,
    })
}

/// Progress without figures.
pub fn stage(stage: Stage, done: usize, total: usize) -> api::Progress {
    api::Progress {
        stage: stage.into(),
        done: done as i64,
        total: total as i64,
        bit_accuracy: None,
        psnr_db: None,
    }
}

/// What is new of an embedding, if it is for the API.
pub fn embedding_progress(progress: &embed::Progress) -> Option<api::Progress> {
    match progress {
        embed::Progress::Step(step) => Some(api::Progress {
            bit_accuracy: Some(step.bit_accuracy),
            psnr_db: Some(step.psnr_db).filter(|db| db.is_finite()),
            ..stage(Stage::Optimising, step.step, step.total)
        }),
        embed::Progress::Verifying { done, total } => Some(stage(Stage::Reading, *done, *total)),
        embed::Progress::Admitted(_)
        | embed::Progress::Covered { .. }
        | embed::Progress::Check(_)
        | embed::Progress::Timed(_)
        | embed::Progress::Stopped { .. }
        | embed::Progress::Writing => None,
    }
}

/// How far a key has come.
pub fn key_progress(progress: KeyProgress) -> api::Progress {
    match progress {
        KeyProgress::Pictures(done, total) | KeyProgress::Decoder(Training::Encoding(done, total)) => {
            stage(Stage::Preparing, done, total)
        }
        KeyProgress::Decoder(Training::Training(done, total)) => stage(Stage::Optimising, done, total),
    }
}

/// The figures of an embedding.
pub fn embed_result(outcome: &Outcome) -> api::EmbedResult {
    let found = &outcome.verification;
    api::EmbedResult {
        bit_accuracy: found.comparison.bit_accuracy,
        bit_accuracy_worst_view: found.comparison.bit_accuracy_worst_view,
        message: found.message.to_string(),
        message_recovered: found.message_recovered,
        psnr_db: found.quality.psnr.psnr_db,
        psnr_covered_db: found.psnr_covered_db,
        covered: found.covered,
        ssim: found.quality.ssim,
        lpips: found.quality.lpips,
        steps: outcome.steps as u32,
        view_steps: outcome.view_steps as u64,
        target_missed: outcome.missed.clone(),
        gaussians: outcome.gaussians as u64,
        changed_gaussians: outcome.changed as u64,
        ignored_rows: outcome.ignored.as_ref().map_or(0, Ignored::count) as u64,
        ..api::EmbedResult::default()
    }
}

/// The figures of a verification.
pub fn verify_result(found: VerificationReport) -> api::VerifyResult {
    let verdict = match found.verdict {
        Verdict::Match => ApiVerdict::Match,
        Verdict::NoMatch => ApiVerdict::NoMatch,
        Verdict::Inconclusive => ApiVerdict::Inconclusive,
        Verdict::UnknownKey => ApiVerdict::UnknownKey,
    };
    api::VerifyResult {
        verdict: verdict.into(),
        p_value: found.p_value,
        threshold: found.threshold,
        matched_bits: found.matched_bits,
        rank_sum: found.rank_sum,
        needed_rank_sum: found.needed_rank_sum,
        bits: found.bits as u32,
        views: found.views as u32,
        message: found.message,
        bit_accuracy: found.bit_accuracy,
        bit_accuracy_worst_view: found.bit_accuracy_worst_view,
        mean_abs_logit: found.mean_abs_logit,
        view_agreement: found.view_agreement,
        reason: found.reason.unwrap_or_default(),
        ignored_rows: found.ignored_rows as u64,
        framings: found.hypotheses as u32,
        framing: found.hypothesis.unwrap_or_default(),
        explained_by_original: found
            .explained_by_original
            .iter()
            .map(|explained| explained.unwrap_or(0.0))
            .collect(),
        ..api::VerifyResult::default()
    }
}

/// What was read under one hypothesis.
pub fn framed_reading(hypothesis: Hypothesis, logits: &PooledLogits) -> api::FramedReading {
    api::FramedReading {
        quarter_turns: hypothesis.quarter_turns.into(),
        mirrored: hypothesis.mirrored,
        trimmed: hypothesis.trimmed,
        views: logits.views.len() as u32,
        logits: logits.summed.clone(),
        undone: undone(hypothesis.correction),
        part: hypothesis.window.map(|window| api::PicturePart {
            left_twelfths: window.left,
            top_twelfths: window.top,
            side_twelfths: window.side,
        }),
        leading_picture: hypothesis.leader.unwrap_or(0),
    }
}

fn undone(correction: PhotometricCorrection) -> Option<api::Undone> {
    use api::undone::Kind;
    let mut channels = [0.0; 3];
    let (kind, factor) = match correction {
        PhotometricCorrection::None => return None,
        PhotometricCorrection::WhiteBalance(beyond) => {
            channels = beyond;
            (Kind::WhiteBalance, 1.0)
        }
        PhotometricCorrection::WhiteBackground => (Kind::Ground, 1.0),
        PhotometricCorrection::Estimated => (Kind::Estimated, 1.0),
        PhotometricCorrection::NextEstimate(place) => (Kind::Estimated, place as f32),
        PhotometricCorrection::Registered(RegisteredTones::AsGiven) => (Kind::Original, 1.0),
        PhotometricCorrection::Registered(RegisteredTones::Fitted) => (Kind::OriginalFitted, 1.0),
        PhotometricCorrection::MatchedFilter => (Kind::OriginalMatched, 1.0),
        PhotometricCorrection::Tone(Tone::Brightness(factor)) => (Kind::Brightness, factor),
        PhotometricCorrection::Tone(Tone::Gamma(exponent)) => (Kind::Gamma, exponent),
        PhotometricCorrection::Tone(Tone::Contrast(factor)) => (Kind::Contrast, factor),
        PhotometricCorrection::Tone(Tone::Saturation(factor)) => (Kind::Saturation, factor),
    };
    let [red, green, blue] = channels;
    Some(api::Undone {
        kind: kind.into(),
        factor,
        red,
        green,
        blue,
    })
}

/// What may be known of a key.
pub fn key(key: &Key) -> api::Key {
    api::Key {
        bits: key.bits() as u32,
        clip: key.clip.name.clone(),
        clip_sha256: key.clip.hash.clone(),
        seeded: key.seed.is_some(),
        ..api::Key::default()
    }
}

/// A duration; absent were it longer than the API can say.
pub fn duration(duration: Duration) -> Option<prost_types::Duration> {
    duration.try_into().ok()
}

/// What users are told of a failed attempt, and whether another one may succeed.
pub fn failure(error: &Error) -> (api::Failure, bool) {
    let (reason, retryable) = match error {
        Error::TargetMissed(_) => (Reason::TargetMissed, false),
        Error::BadJob(_) => (Reason::InvalidInput, false),
        Error::Panicked(_) | Error::Stuck(_) => (Reason::Internal, true),
        // What is missing, or is not a certificate, is so next time too.
        Error::Credentials(_) => (Reason::Internal, false),
        Error::Engine(error) => match error {
            EngineError::BadScene { .. }
            | EngineError::BadPicture { .. }
            | EngineError::BadCameras { .. }
            | EngineError::BadOption { .. } => (Reason::InvalidInput, false),
            // Another worker may have more memory, but nothing says that one is there.
            EngineError::DoesNotFit { .. } => (Reason::InvalidInput, false),
            EngineError::Device { .. } => (Reason::WorkerLost, true),
            // The same numbers come out next time.
            EngineError::NotFinite { .. } => (Reason::Internal, false),
            // A full disk, or a key whose CLIP only other workers have.
            _ => (Reason::Internal, true),
        },
        _ => (Reason::Internal, true),
    };
    let failure = api::Failure {
        reason: reason.into(),
        message: match error {
            // The reason says the rest.
            Error::TargetMissed(missed) => missed.clone(),
            other => other.to_string(),
        },
    };
    (failure, retryable)
}

#[cfg(test)]
mod tests;
