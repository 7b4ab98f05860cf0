//! Whatever is computed ends when it is asked to.
use guardsplat_engine::Error;
use guardsplat_engine::embed::{Job, Progress, embed};
use guardsplat_engine::extract::read_scene;
use guardsplat_engine::message::key::KeyProgress;
use guardsplat_engine::message::training::Progress as Training;
use guardsplat_engine::scene::BadRows;
use guardsplat_engine::stop::Stop;
use guardsplat_engine::view::ViewSampler;

use super::{cpu, engine, files, message, new_key_until, run, scene_file, settings, small_scene};

#[test]
fn whatever_is_computed_ends_when_it_is_asked_to() {
    let (folder, input) = scene_file();
    let output = folder.path().join("out.ply");
    let stopped_at = |when: fn(&Progress) -> bool| {
        let engine = engine();
        let stop = engine.stop.clone();
        let job = Job {
            input: &input,
            output: &output,
            message: &message(),
            settings: &settings(),
            cameras: &[],
            force: true,
            bad_rows: BadRows::Refuse,
        };
        let mut told = Vec::new();
        let result = embed(&engine, &job, &mut |progress| {
            if when(&progress) {
                stop.request();
            }
            told.push(progress);
        });
        assert!(matches!(result, Err(Error::Stopped)), "{result:?}");
        assert_eq!(files(folder.path()), ["in.ply"]);
        told
    };
    let told = stopped_at(|progress| matches!(progress, Progress::Step(step) if step.step == 2));
    // Before the steps it is told what memory is needed, and which Gaussians can be seen.
    // Before the steps it is told what memory is needed, and which Gaussians can be seen; of each step also how long it took.
    assert_eq!(told.len(), 6);
    let told = stopped_at(|progress| matches!(progress, Progress::Verifying { done: 1, .. }));
    assert!(matches!(told.last(), Some(Progress::Verifying { done: 1, .. })));
    // The last view is read and only compared afterwards.
    stopped_at(|progress| matches!(progress, Progress::Verifying { done: 4, .. }));

    let engine = engine();
    engine.stop.request();
    let nothing = run(&engine, &folder.path().join("none.ply"), &output, &settings(), true);
    assert!(matches!(nothing, Err(Error::Stopped)), "not even looked for");
    let unread = read_scene(
        &engine,
        &small_scene(),
        &ViewSampler::new(&small_scene(), 3).unwrap(),
        4,
        32,
        [1.0; 3],
        |_, _| Ok(()),
    );
    assert!(matches!(unread, Err(Error::Stopped)));
}

#[test]
fn a_key_under_way_ends_when_it_is_asked_to() {
    let compute = cpu();
    for training in [false, true] {
        let stop = Stop::default();
        let mut told = 0;
        let made = new_key_until(&compute, 1, &stop, |progress| {
            told += 1;
            if matches!(progress, KeyProgress::Decoder(Training::Training(..))) == training {
                stop.request();
            }
        });
        assert!(matches!(made, Err(Error::Stopped)));
        assert!(training || told == 1, "{told} more");
    }
}
