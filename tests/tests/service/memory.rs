//! Scenes that do not fit in the memory that an operator gives to a job.
use guardsplat_tests::Service;
use guardsplat_tests::ply::Ply;

use crate::{KEY, environment};

const LIMIT: u64 = 64 << 20;

#[test]
fn scenes_that_do_not_fit_are_refused_with_the_numbers() {
    let environment = environment();
    // Each Gaussian takes 56 bytes in its file and as much in memory, and twice that to be marked.
    environment.write("vast.ply", Ply::new(320_000, 0).bytes());
    environment.write("large.ply", Ply::new(200_000, 0).bytes());
    let service = Service::start(environment, "--embedded-worker true --max-job-memory-mebibytes 64");
    service.json(KEY, 0);

    // One that can't fit is not even queued.
    let line = |scene: &str| format!("embed {scene} -o out.ply --key site --message c0ffee42 --size 32");
    let error = &service.json(&line("vast.ply"), 1)["error"];
    assert_eq!(
        (&error["code"], &error["reason"]),
        (&"FAILED_PRECONDITION".into(), &"SCENE_DOES_NOT_FIT".into()),
        "{error}"
    );
    let number = |field: &str| error["metadata"][field].as_str().unwrap().parse::<u64>().unwrap();
    assert_eq!((number("gaussians"), number("limit_bytes")), (320_000, LIMIT));
    assert!(number("needed_bytes") > LIMIT, "{error}");
    let told = service.client(&line("vast.ply"));
    let told = String::from_utf8_lossy(&told.stderr).into_owned();
    for words in ["320000 Gaussians", "take 69 MiB", "a job may take 64 MiB"] {
        assert!(told.contains(words), "{told}");
    }
    let jobs = service.json("jobs list", 0);
    assert_eq!(jobs["jobs"].as_array().unwrap().len(), 1, "{jobs}");
    // What was sent for it is gone, and only the key is kept.
    service.keeps(1);

    // One that might fit is the worker's to refuse, which has the same limit and knows more.
    let error = &service.json(&line("large.ply"), 1)["error"];
    assert_eq!(error["reason"], "invalid_input", "{error}");
    let message = error["message"].as_str().unwrap();
    for words in ["200000 Gaussians", "scene 43 MiB", "its budget is 64 MiB"] {
        assert!(message.contains(words), "{message}");
    }
    let job = service.job(error["job"].as_str().unwrap());
    assert_eq!((&job["state"], &job["attempt"]), (&"failed".into(), &1.into()), "{job}");
    // To be read, it fits.
    let read = service.json("verify large.ply --key site --views 1 --size 32", 3);
    assert_eq!(read["verdict"], "inconclusive");
}
