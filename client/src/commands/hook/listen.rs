//! `hook listen`: takes the service's calls, and answers 2xx only when what is to be done for one is done.
use std::collections::{HashSet, VecDeque};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;
use hyper::StatusCode;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::output::{Exit, print_line, say};
use crate::resource_names;
use crate::transfer::{Destination, Source, download};
use crate::webhook::program::Program;
use crate::webhook::{server, signature::Secret};

/// Where the secret is taken from, if not from a file.
const SECRET_VARIABLE: &str = "GUARDSPLAT_HOOK_SECRET";
/// What an event of a marked scene is of.
const SUCCEEDED: &str = "guardsplat.job.succeeded.v1";
/// Events that are remembered as done.
const REMEMBERED: usize = 10_000;

/// Arguments of `hook listen`.
#[derive(Args)]
pub struct Arguments {
    /// Address and port to listen on, for plain HTTP: put a server that speaks TLS before it
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8787")]
    listen: SocketAddr,
    /// File of the secret that `hook create` printed; GUARDSPLAT_HOOK_SECRET goes before it
    #[arg(long, value_name = "FILE")]
    secret_file: Option<PathBuf>,
    /// Folder for what comes of jobs: JOB.json with the event, and for a marked scene JOB with its extension, before that
    #[arg(long, value_name = "FOLDER")]
    folder: Option<PathBuf>,
    /// A program and its arguments, after `--`, to be run for each event: the event is on its standard input, and
    /// GUARDSPLAT_EVENT, GUARDSPLAT_JOB, GUARDSPLAT_KIND, GUARDSPLAT_STATE, GUARDSPLAT_REQUEST_ID,
    /// GUARDSPLAT_DISPLAY_NAME and GUARDSPLAT_SCENE (the file that was fetched) say the main things. Where it does not
    /// exit with 0, the service calls again later
    #[arg(last = true, value_name = "PROGRAM")]
    program: Vec<String>,
}

/// What an event has that matters here.
#[derive(Deserialize)]
struct Event {
    id: String,
    r#type: String,
    data: Data,
}

#[derive(Deserialize)]
struct Data {
    job: String,
    kind: String,
    state: String,
    #[serde(default)]
    display_name: String,
    #[serde(default)]
    request_id: Option<String>,
    #[serde(default)]
    artifacts: Vec<Artifact>,
}

#[derive(Deserialize)]
struct Artifact {
    role: String,
    name: String,
    display_name: String,
    sha256: String,
}

/// Listens until it is interrupted.
pub async fn run(context: &Context, arguments: &Arguments) -> Result<Exit> {
    let secret = secret(arguments)?;
    if let Some(folder) = &arguments.folder {
        Destination::check(&folder.join("event.json"))?;
    }
    let doorkeeper = move |headers: &hyper::HeaderMap, body: &[u8]| {
        secret.check(headers, body, now()).map_err(|reason| {
            say(&format!("refused a call: {reason}"));
            StatusCode::UNAUTHORIZED
        })
    };
    let (address, mut calls) = server::listen(arguments.listen, Arc::new(doorkeeper)).await?;
    // For whoever started it with port 0.
    context.console.say(&format!("listening on http://{address}"));
    let program = Program::new(&arguments.program);
    let mut done = Done::default();
    while let Some(call) = calls.recv().await {
        let outcome = take(context, arguments, program.as_ref(), &mut done, &call.body).await;
        if let Err(error) = &outcome {
            say(&format!("error: {error}; the service will call again"));
        }
        call.answer(outcome.is_ok());
    }
    Ok(Exit::Done)
}

fn secret(arguments: &Arguments) -> Result<Secret> {
    let variable = std::env::var(SECRET_VARIABLE)
        .ok()
        .filter(|text| !text.trim().is_empty());
    let text = match (variable, &arguments.secret_file) {
        (Some(text), _) => text,
        (None, Some(path)) => std::fs::read_to_string(path).map_err(Error::io(path))?,
        (None, None) => String::new(),
    };
    Secret::parse(&text).ok_or_else(|| Error::BadOption {
        field: "--secret-file",
        reason: format!("neither it nor {SECRET_VARIABLE} has the secret that `hook create` printed"),
    })
}

/// Does what is to be done for an event.
async fn take(
    context: &Context,
    arguments: &Arguments,
    program: Option<&Program>,
    done: &mut Done,
    body: &[u8],
) -> Result<()> {
    let event: Event = serde_json::from_slice(body).map_err(|error| Error::Answer {
        reason: format!("an event can't be read: {error}"),
    })?;
    if done.has(&event.id) {
        // The answer was lost, or came too late.
        return Ok(());
    }
    let mut scene = None;
    if let Some(folder) = &arguments.folder {
        scene = fetch(context, folder, &event).await?;
        keep(folder, &event, body)?;
    }
    if let Some(program) = program {
        let said = program.run(body, &variables(&event, scene.as_deref())).await?;
        // What it has to say is for whoever reads this one's output.
        if !said.trim().is_empty() {
            print_line(said.trim_end());
        }
    }
    if arguments.folder.is_none() && program.is_none() {
        print_line(&String::from_utf8_lossy(body));
    }
    context.console.say(&format!("{} {}", event.data.job, event.data.state));
    done.add(event.id);
    Ok(())
}

/// Fetches a marked scene; where it is, if there is one.
async fn fetch(context: &Context, folder: &Path, event: &Event) -> Result<Option<PathBuf>> {
    let scene = event.data.artifacts.iter().find(|artifact| artifact.role == "scene");
    let Some(scene) = scene.filter(|_| event.r#type == SUCCEEDED && event.data.kind == "embed") else {
        return Ok(None);
    };
    let path = folder.join(format!("{}{}", id_of(event)?, extension(&scene.display_name)));
    // A call that comes again while the first was answered too late finds it there.
    if path.is_file() && Source::hash(&path).await?.sha256 == scene.sha256 {
        return Ok(Some(path));
    }
    let fetched = download(context, &resource_names::artifact(&scene.name)?, &path).await?;
    context.console.clear();
    if fetched.sha256 != scene.sha256 {
        return Err(Error::Damaged {
            path,
            reason: "the server has other bytes than the event tells of".into(),
        });
    }
    Ok(Some(path))
}

/// Keeps the event itself, when all that it tells of is there.
fn keep(folder: &Path, event: &Event, body: &[u8]) -> Result<()> {
    let path = folder.join(format!("{}.json", id_of(event)?));
    let mut file = Destination::new(&path)?;
    file.write(body)?;
    file.finish(body.len() as u64, &hex::encode(Sha256::digest(body)))?;
    Ok(())
}

/// The id of the job, which is a file's name here: nothing that leads elsewhere gets further than this.
fn id_of(event: &Event) -> Result<Uuid> {
    let job = resource_names::job(&event.data.job)?;
    let id = job.strip_prefix("jobs/").and_then(|id| Uuid::try_parse(id).ok());
    id.ok_or_else(|| Error::Answer {
        reason: "an event names no job".into(),
    })
}

/// `.compressed.ply` of `marked.compressed.ply`; nothing of a name that would do more than name a format.
fn extension(display_name: &str) -> String {
    let plain = |text: &str| text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'.') && !text.contains("..");
    match display_name.split_once('.') {
        Some((_, extension)) if !extension.is_empty() && extension.len() <= 20 && plain(extension) => {
            format!(".{}", extension.to_ascii_lowercase())
        }
        _ => String::new(),
    }
}

fn variables(event: &Event, scene: Option<&Path>) -> Vec<(&'static str, String)> {
    let data = &event.data;
    vec![
        ("GUARDSPLAT_EVENT", event.r#type.clone()),
        ("GUARDSPLAT_JOB", data.job.clone()),
        ("GUARDSPLAT_KIND", data.kind.clone()),
        ("GUARDSPLAT_STATE", data.state.clone()),
        ("GUARDSPLAT_REQUEST_ID", data.request_id.clone().unwrap_or_default()),
        ("GUARDSPLAT_DISPLAY_NAME", data.display_name.clone()),
        (
            "GUARDSPLAT_SCENE",
            scene.map(|path| path.display().to_string()).unwrap_or_default(),
        ),
    ]
}

fn now() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_secs()).unwrap_or(i64::MAX)
}

/// Events that are done, the last of them.
#[derive(Default)]
struct Done {
    ids: HashSet<String>,
    order: VecDeque<String>,
}

impl Done {
    fn has(&self, id: &str) -> bool {
        self.ids.contains(id)
    }

    fn add(&mut self, id: String) {
        if self.ids.insert(id.clone()) {
            self.order.push_back(id);
        }
        if self.order.len() > REMEMBERED
            && let Some(oldest) = self.order.pop_front()
        {
            self.ids.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extensions_name_formats_and_nothing_else() {
        for (name, expected) in [
            ("marked.ply", ".ply"),
            ("marked.compressed.PLY", ".compressed.ply"),
            ("marked", ""),
            ("marked.", ""),
            ("a./../../x", ""),
            ("a...", ""),
            ("a.pl y", ""),
        ] {
            assert_eq!(extension(name), expected, "{name}");
        }
    }

    #[test]
    fn only_so_many_events_are_remembered() {
        let mut done = Done::default();
        for i in 0..=REMEMBERED {
            done.add(i.to_string());
            done.add(i.to_string());
        }
        assert!(!done.has("0") && done.has("1") && done.has(&REMEMBERED.to_string()));
        assert_eq!((done.ids.len(), done.order.len()), (REMEMBERED, REMEMBERED));
    }
}
