//! One attempt at a leased job: what all kinds of jobs need on the way from inputs to outputs.
use std::path::{Path, PathBuf};

use guardsplat_engine::Error as EngineError;
use guardsplat_engine::stop::Stop;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{FramedReading, Job, SeenView, complete_job_request};

use super::accelerator::Accelerator;
use super::convert;
use super::engine_cache::EngineCache;
use super::error::{Error, Result};
use super::lease::{Lease, Reporter};
use super::server::Server;
use super::transfer::{self, Content};
use super::{create_key_job, embed_job, verify_job};
use crate::credentials_program::Certificate;

/// What came out of an attempt.
pub struct Outcome {
    /// For the job's owner.
    pub result: complete_job_request::Result,
    /// For the server, which decides claims.
    pub readings: Vec<FramedReading>,
    /// For people who look at the evidence.
    pub views: Vec<SeenView>,
}

impl From<complete_job_request::Result> for Outcome {
    fn from(result: complete_job_request::Result) -> Self {
        Self {
            result,
            readings: Vec::new(),
            views: Vec::new(),
        }
    }
}

/// An artifact that was fetched.
pub struct Input {
    /// Where it is.
    pub path: PathBuf,
    /// The name of its file where it came from; empty where nobody said.
    pub name: String,
}

/// An attempt under way.
pub struct Attempt<'a> {
    /// Where inputs come from and outputs go.
    pub server: &'a Server,
    /// Where to compute.
    pub accelerator: &'a Accelerator,
    /// The right to it.
    pub lease: &'a Lease,
    /// For the job's files.
    pub folder: &'a Path,
    /// Ends the computing.
    pub stop: &'a Stop,
    /// Hears of progress.
    pub reporter: Reporter,
    /// Who signs content credentials.
    pub certificate: &'a Certificate,
    /// What users know the downloaded files as.
    pub known_as: Vec<(PathBuf, String)>,
}

impl Attempt<'_> {
    /// Does all that the job asks for.
    ///
    /// # Errors
    /// Whatever goes wrong, with files called as users know them.
    pub async fn carry_out(&mut self, job: &Job) -> Result<()> {
        self.reporter.tell(convert::stage(Stage::Preparing, 0, 0));
        let result = self.compute_and_store(job).await;
        let result = result.map_err(|error| match error {
            Error::Engine(error) => Error::Engine(renamed(error, &self.known_as)),
            other => other,
        })?;
        self.lease.complete(result).await
    }

    async fn compute_and_store(&mut self, job: &Job) -> Result<Outcome> {
        match &job.spec {
            Some(Spec::Embed(spec)) => embed_job::carry_out(self, spec).await,
            Some(Spec::Verify(spec)) => verify_job::carry_out(self, spec).await,
            Some(Spec::CreateKey(spec)) => create_key_job::carry_out(self, spec).await,
            None => Err(Error::Damaged {
                what: job.name.clone(),
                reason: "a kind of job that this worker does not know".into(),
            }),
        }
    }

    /// Fetches artifacts; the files are in their order.
    pub async fn download(&mut self, names: &[&str]) -> Result<Vec<Input>> {
        let mut inputs = Vec::with_capacity(names.len());
        for (index, name) in names.iter().enumerate() {
            let path = self.folder.join(format!("input-{index}"));
            let artifact = transfer::download(self.server, name, &path).await?;
            let known_as = match artifact.display_name.as_str() {
                "" => (*name).to_owned(),
                display_name => format!("{display_name} ({name})"),
            };
            self.known_as.push((path.clone(), known_as));
            inputs.push(Input {
                path,
                name: artifact.display_name,
            });
            let (done, total) = (index + 1, names.len());
            self.reporter.tell(convert::stage(Stage::Preparing, done, total));
        }
        Ok(inputs)
    }

    /// Fetches the bytes of the job's key.
    pub async fn download_key(&self) -> Result<Vec<u8>> {
        transfer::download_key(self.server, self.lease).await
    }

    /// Does `work` with the engine.
    pub async fn compute<T: Send + 'static>(
        &self,
        work: impl FnOnce(&mut EngineCache, &Stop, &Reporter) -> Result<T> + Send + 'static,
    ) -> Result<T> {
        self.reporter.tell(convert::stage(Stage::Preparing, 0, 0));
        let (stop, reporter) = (self.stop.clone(), self.reporter.clone());
        self.accelerator.run(move |cache| work(cache, &stop, &reporter)).await?
    }

    /// Stores an output under a name for people, and gives its artifact's.
    pub async fn upload(&self, name: &str, content: Content, secret: bool) -> Result<String> {
        self.reporter.tell(convert::stage(Stage::Storing, 0, 0));
        transfer::upload(self.server, self.lease, name, &content, secret).await
    }
}

/// The error of a downloaded file, told of what users know it as.
fn renamed(error: EngineError, known_as: &[(PathBuf, String)]) -> EngineError {
    let name = |path: PathBuf| match known_as.iter().find(|(known, _)| *known == path) {
        Some((_, name)) => name.into(),
        None => path,
    };
    match error {
        EngineError::BadScene { path, reason } => EngineError::BadScene {
            path: name(path),
            reason,
        },
        EngineError::BadPicture { path, reason } => EngineError::BadPicture {
            path: name(path),
            reason,
        },
        EngineError::BadCameras { path, reason } => EngineError::BadCameras {
            path: name(path),
            reason,
        },
        EngineError::Io { path, source } => EngineError::Io {
            path: name(path),
            source,
        },
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn users_hear_of_their_own_files() {
        let known_as = [(PathBuf::from("/tmp/job/input-0"), "robot.ply (artifacts/7)".to_owned())];
        let bad = |path: &str| EngineError::BadScene {
            path: path.into(),
            reason: "row 3".into(),
        };
        let told = |path: &str| renamed(bad(path), &known_as).to_string();
        assert_eq!(told("/tmp/job/input-0"), "robot.ply (artifacts/7): row 3");
        assert_eq!(told("/tmp/job/marked.ply"), "/tmp/job/marked.ply: row 3");
    }
}
