//! Where a worker keeps the files of the job at hand: a folder that goes with the worker, killed or not.
use std::fs::File;
use std::path::Path;

use tempfile::TempDir;

use super::error::{Error, Result};

/// What the folders of workers are called.
const PREFIX: &str = "guardsplat-worker-";
/// Held locked in a worker's folder for as long as the worker lives.
const LOCK: &str = "lock";

/// A worker's own folder, readable by its user only; deleted when dropped.
pub struct WorkDirectory {
    folder: TempDir,
    _lock: File,
}

impl WorkDirectory {
    /// Makes a folder in `parent`, and deletes those that workers left there which were killed.
    pub fn new(parent: &Path) -> Result<Self> {
        clear(parent);
        let io = || Error::io(parent);
        loop {
            let folder = tempfile::Builder::new()
                .prefix(PREFIX)
                .tempdir_in(parent)
                .map_err(io())?;
            let path = folder.path().join(LOCK);
            let lock = File::create(&path).map_err(Error::io(&path))?;
            lock.lock().map_err(Error::io(&path))?;
            // Another worker that starts just now may have taken the file for a dead one's before it was locked.
            if path.exists() {
                return Ok(Self { folder, _lock: lock });
            }
        }
    }

    /// An empty folder for one job; deleted when dropped.
    pub fn of_job(&self) -> Result<TempDir> {
        let path = self.folder.path();
        tempfile::Builder::new()
            .prefix("job-")
            .tempdir_in(path)
            .map_err(Error::io(path))
    }
}

/// Deletes folders whose workers are dead. What can't be looked at or deleted is another user's, or none of ours.
fn clear(parent: &Path) {
    let Ok(entries) = std::fs::read_dir(parent) else {
        return;
    };
    for entry in entries.flatten() {
        let ours = entry.file_name().to_string_lossy().starts_with(PREFIX);
        // `file_type` does not follow links.
        if !ours || !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            continue;
        }
        // Held until the folder is gone, so that a worker that is just making it notices.
        let Some(_lock) = abandoned(&entry.path().join(LOCK)) else {
            continue;
        };
        match std::fs::remove_dir_all(entry.path()) {
            Ok(()) => tracing::info!("deleted {}, which a dead worker left", entry.path().display()),
            Err(error) => tracing::warn!("{}: {error}", entry.path().display()),
        }
    }
}

/// The lock of a worker's folder, if it is there and nobody held it.
fn abandoned(lock: &Path) -> Option<File> {
    let file = File::open(lock).ok()?;
    file.try_lock().ok()?;
    Some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_of_dead_workers_go_and_those_of_the_living_stay() {
        let parent = tempfile::tempdir().unwrap();
        let living = WorkDirectory::new(parent.path()).unwrap();
        let job = living.of_job().unwrap();
        std::fs::write(job.path().join("scene.ply"), "ply").unwrap();
        // As a worker leaves it that was killed: the lock is free.
        let dead = parent.path().join("guardsplat-worker-dead");
        std::fs::create_dir_all(dead.join("job-1")).unwrap();
        std::fs::write(dead.join(LOCK), "").unwrap();
        let foreign = parent.path().join("something-else");
        std::fs::create_dir(&foreign).unwrap();

        let other = WorkDirectory::new(parent.path()).unwrap();
        assert!(!dead.exists() && foreign.exists());
        assert!(job.path().join("scene.ply").exists());
        drop((other, job, living));
        assert_eq!(
            std::fs::read_dir(parent.path()).unwrap().count(),
            1,
            "only the foreign one is left"
        );
    }
}
