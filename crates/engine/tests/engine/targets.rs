//! When a mark is good enough: targets, marks that are made weaker, and the early stop.
use guardsplat_engine::embed::{Preset, Progress, Settings, optimise};
use guardsplat_engine::scene::Scene;

use super::{engine, files, message, run, scene_file, settings, small_scene};

#[test]
fn a_missed_target_writes_nothing_unless_forced() {
    let ((folder, input), engine) = (scene_file(), engine());
    let output = folder.path().join("out.ply");
    let mut strict = settings();
    strict.steps = 1;
    strict.target.bit_accuracy = 1.1;
    strict.target.psnr_db = 1e3;
    strict.target.message = true;
    std::fs::write(&output, "before").unwrap();
    let missed = run(&engine, &input, &output, &strict, false).unwrap();
    assert!(!missed.written);
    assert!(missed.missed.len() >= 2, "{:?}", missed.missed);
    assert_eq!(std::fs::read(&output).unwrap(), b"before");
    assert_eq!(files(folder.path()), ["in.ply", "out.ply"]);

    let forced = run(&engine, &input, &output, &strict, true).unwrap();
    assert!(forced.written && forced.missed == missed.missed);
    assert_eq!(
        std::fs::metadata(&output).unwrap().len(),
        std::fs::metadata(&input).unwrap().len()
    );
}

#[test]
fn a_mark_a_little_too_strong_is_made_weaker_and_one_far_too_strong_is_refused() {
    let ((folder, input), engine) = (scene_file(), engine());
    let output = folder.path().join("out.ply");
    let mut wanted = settings();
    let mut psnr = |target: f64| {
        wanted.target.psnr_db = target;
        let done = run(&engine, &input, &output, &wanted, false).unwrap();
        (done.verification.quality.psnr.psnr_db.unwrap(), done.written)
    };
    let (as_learned, written) = psnr(0.0);
    assert!(written);
    let (weaker, written) = psnr(as_learned + 0.6);
    assert!(
        written && (0.6..0.9).contains(&(weaker - as_learned)),
        "{as_learned} {weaker}"
    );
    assert_eq!(psnr(as_learned + 3.0), (as_learned, false));
}

#[test]
fn a_held_out_margin_that_holds_ends_the_run() {
    let (engine, scene) = (engine(), Scene::from_gaussians(small_scene()));
    let mut easy = Preset::Standard.settings().early_stop.unwrap();
    (easy.every, easy.views, easy.min_steps, easy.patience) = (2, 2, 5, 2);
    (easy.bit_accuracy, easy.margin, easy.psnr_db) = (0.0, -1e9, 0.0);
    let settings = Settings {
        steps: 50,
        early_stop: Some(easy),
        ..settings()
    };
    let mut told = Vec::new();
    let done = optimise(&engine, &scene, &message(), &settings, &[], &mut |p| told.push(p)).unwrap();
    // Checks at 2, 4 and 6 hold; 6 is the first past the least number of steps.
    assert_eq!((done.steps, done.view_steps), (6, 24));
    assert_eq!(told.last(), Some(&Progress::Stopped { step: 6 }));
    let checks = told.iter().filter(|p| matches!(p, Progress::Check(_)));
    assert_eq!(checks.count(), 3);
}
