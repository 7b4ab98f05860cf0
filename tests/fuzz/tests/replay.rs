//! Every file of the corpus through its target, with the limit of memory: what once went wrong stays right.
use guardsplat_fuzz::{TARGETS, memory};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn names(folder: &Path) -> BTreeSet<String> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

// One test, since memory is counted for the whole process.
#[test]
fn the_corpus_is_read_without_a_panic() {
    for target in TARGETS {
        let folder = folder("corpus").join(target.name);
        let files = names(&folder);
        assert!(!files.is_empty(), "{} has no corpus", target.name);
        for file in &files {
            let bytes = std::fs::read(folder.join(file)).unwrap();
            let run = std::panic::AssertUnwindSafe(|| (target.run)(&bytes));
            assert!(
                std::panic::catch_unwind(run).is_ok(),
                "corpus/{}/{file}, see above",
                target.name
            );
        }
        println!(
            "{:16} {:4} files, {:9} bytes at most",
            target.name,
            files.len(),
            memory::take_highest()
        );
    }
}

#[test]
fn every_target_has_its_files_and_nothing_is_left_over() {
    let targets: BTreeSet<String> = TARGETS.iter().map(|target| target.name.to_string()).collect();
    assert_eq!(names(&folder("corpus")), targets);
    let programs: BTreeSet<String> = targets.iter().map(|name| format!("{name}.rs")).collect();
    assert_eq!(names(&folder("fuzz_targets")), programs);
    let manifest = std::fs::read_to_string(folder("Cargo.toml")).unwrap();
    for name in &targets {
        assert!(
            manifest.contains(&format!("name = \"fuzz_{name}\"")),
            "Cargo.toml has no program for {name}"
        );
    }
    for dictionary in names(&folder("dictionaries")) {
        let name = dictionary.trim_end_matches(".dict");
        assert!(targets.contains(name), "{dictionary} belongs to no target");
    }
}
