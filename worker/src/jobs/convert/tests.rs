//! What the API says is what the engine does.
use guardsplat_codeword::{AcceptanceRule, DEFAULT_FALSE_POSITIVE_RATE, Message, MessageCode};
use guardsplat_engine::embed::{LossTerms, Progress, Step};
use guardsplat_engine::extract::PooledLogits;

use super::*;

#[test]
fn presets_seeds_and_sizes_reach_the_settings() {
    let spec = |preset: ApiPreset| api::EmbedSpec {
        preset: preset.into(),
        seed: 7,
        ..api::EmbedSpec::default()
    };
    for (named, preset) in [
        (ApiPreset::Unspecified, Preset::Standard),
        (ApiPreset::Draft, Preset::Draft),
        (ApiPreset::Standard, Preset::Standard),
        (ApiPreset::Robust, Preset::Robust),
        (ApiPreset::Thorough, Preset::Thorough),
        (ApiPreset::Paper, Preset::Paper),
    ] {
        let expected = Settings {
            seed: 7,
            ..preset.settings()
        };
        assert_eq!(settings(&spec(named)).unwrap(), expected);
    }
    let sized = |size| {
        settings(&api::EmbedSpec {
            size,
            ..spec(ApiPreset::Draft)
        })
    };
    let found = sized(96).unwrap();
    assert_eq!((found.size, found.verify.size), (96, Some(96)));
    assert_eq!(sized(4).err().unwrap().to_string(), "size: 4 is outside 16 to 4096");
    let standing = |robust_to: Vec<i32>| {
        settings(&api::EmbedSpec {
            robust_to,
            ..api::EmbedSpec::default()
        })
    };
    let every: Vec<i32> = (1..).take_while(|n| Distortion::try_from(*n).is_ok()).collect();
    assert_eq!(standing(every).unwrap().robust_to, RobustTo::all());
    let some = standing(vec![Distortion::Noise.into(), Distortion::Jpeg.into()]).unwrap();
    assert_eq!(some.robust_to.to_string(), "jpeg,noise");
    assert_eq!(
        standing(vec![0]).err().unwrap().to_string(),
        "robust_to: 0 is no distortion"
    );
    let kind = |scene_kind: i32| {
        settings(&api::EmbedSpec {
            scene_kind,
            ..api::EmbedSpec::default()
        })
    };
    assert_eq!(kind(0).unwrap().kind, None);
    let named: Vec<_> = (1..=5)
        .map(|number| kind(number).unwrap().kind.unwrap().name())
        .collect();
    assert_eq!(named, ["object", "room", "terrain", "forward", "unbounded"]);
    assert_eq!(kind(6).err().unwrap().to_string(), "scene_kind: 6 is none");
    let none = settings(&api::EmbedSpec {
        preset: 9,
        ..api::EmbedSpec::default()
    });
    assert_eq!(none.err().unwrap().to_string(), "preset: 9 is none");
}

#[test]
fn views_have_defaults_and_limits() {
    let of = |count, size| {
        views(&api::VerifySpec {
            views: count,
            size,
            seed: 3,
            ..api::VerifySpec::default()
        })
    };
    let found = of(0, 0).unwrap();
    assert_eq!(
        (found.count, found.size, found.seed, found.background),
        (20, None, 3, WHITE)
    );
    assert_eq!(found.bad_rows, BadRows::Refuse);
    let ignoring = views(&api::VerifySpec {
        ignore_bad_rows: true,
        ..api::VerifySpec::default()
    });
    assert_eq!(ignoring.unwrap().bad_rows, BadRows::Ignore);
    let found = of(10_000, 16).unwrap();
    assert_eq!((found.count, found.size), (10_000, Some(16)));
    assert_eq!(
        of(10_001, 0).err().unwrap().to_string(),
        "views: 10001 is outside 1 to 10000"
    );
    assert_eq!(
        of(1, 4097).err().unwrap().to_string(),
        "size: 4097 is outside 16 to 4096"
    );
}

#[test]
fn progress_leaves_out_what_is_no_number() {
    let step = |psnr_db| {
        embedding_progress(&Progress::Step(Step {
            step: 3,
            total: 200,
            bit_accuracy: 0.75,
            psnr_db,
            terms: LossTerms::default(),
            balance: 1.0,
        }))
        .unwrap()
    };
    let found = step(36.5);
    assert_eq!((found.stage(), found.done, found.total), (Stage::Optimising, 3, 200));
    assert_eq!((found.bit_accuracy, found.psnr_db), (Some(0.75), Some(36.5)));
    assert_eq!(step(f64::INFINITY).psnr_db, None);
    let reading = embedding_progress(&Progress::Verifying { done: 2, total: 20 }).unwrap();
    assert_eq!((reading.stage(), reading.done, reading.total), (Stage::Reading, 2, 20));
    assert_eq!(embedding_progress(&Progress::Writing), None);
    let training = key_progress(KeyProgress::Decoder(Training::Training(64, 1152)));
    assert_eq!((training.stage(), training.done), (Stage::Optimising, 64));
}

#[test]
fn findings_keep_their_figures() {
    let reading = PooledLogits::new(vec![vec![2.0; 32], vec![-1.0; 32]]).unwrap();
    let message = Message::parse("ffffffff", 32).unwrap();
    let rule = AcceptanceRule {
        false_positive_rate: DEFAULT_FALSE_POSITIVE_RATE,
        hypotheses: 1,
    };
    let comparison = reading.compare(&MessageCode::Plain, &message, &rule).unwrap();
    let found = verify_result(VerificationReport::new(&MessageCode::Plain, &reading, Some(&comparison), &[]).unwrap());
    assert_eq!(found.verdict(), ApiVerdict::Match);
    assert_eq!((found.matched_bits, found.bits, found.views), (Some(32), 32, 2));
    assert_eq!(
        (found.bit_accuracy, found.bit_accuracy_worst_view),
        (Some(0.5), Some(0.0))
    );
    assert!(found.p_value.unwrap() <= found.threshold.unwrap() && found.reason.is_empty());
    let alone = verify_result(VerificationReport::new(&MessageCode::Plain, &reading, None, &[]).unwrap());
    assert_eq!((alone.verdict(), alone.p_value), (ApiVerdict::Inconclusive, None));
    assert_eq!(alone.message, "ffffffff");
    assert!(
        alone.reason.contains("any scene reads as some message"),
        "{}",
        alone.reason
    );
}

#[test]
fn failures_say_whose_fault_it_is() {
    let told = |error: Error| {
        let (failure, retryable) = failure(&error);
        (failure.reason(), retryable)
    };
    let path = || "robot.ply".into();
    let reason = || "row 3".to_owned();
    let engine = |error: EngineError| told(Error::Engine(error));
    assert_eq!(
        engine(EngineError::BadScene {
            path: path(),
            reason: reason()
        }),
        (Reason::InvalidInput, false)
    );
    let field = "message";
    assert_eq!(
        engine(EngineError::BadOption {
            field,
            reason: reason()
        }),
        (Reason::InvalidInput, false)
    );
    let device = || "wgpu".to_owned();
    assert_eq!(
        engine(EngineError::Device {
            device: device(),
            reason: reason()
        }),
        (Reason::WorkerLost, true)
    );
    let full = std::io::Error::from(std::io::ErrorKind::StorageFull);
    assert_eq!(
        engine(EngineError::Io {
            path: path(),
            source: full
        }),
        (Reason::Internal, true)
    );
    assert_eq!(told(Error::Panicked("index".into())), (Reason::Internal, true));
    assert_eq!(told(Error::BadJob("views".into())), (Reason::InvalidInput, false));
    let (missed, retryable) = failure(&Error::TargetMissed("PSNR 33.10 dB is below 34 dB".into()));
    assert_eq!((missed.reason(), retryable), (Reason::TargetMissed, false));
    assert_eq!(missed.message, "PSNR 33.10 dB is below 34 dB");
}
