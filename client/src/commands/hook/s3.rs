//! `hook s3`: takes notifications of an S3 store, and has scenes marked that were put into a bucket.
//!
//! A store sends a notification again until it is acknowledged, and sometimes twice. Each object is a request with a name
//! of its own, so that however often one is told of, it is one job.
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{EmbedSpec, Key};
use guardsplat_scene::Format;
use hyper::StatusCode;
use sha2::{Digest, Sha256};
use tonic::Code;

use crate::arguments::{LONGEST_NAME, Submission};
use crate::commands::embed::Preset;
use crate::commands::{key, suspects};
use crate::context::Context;
use crate::create::create_with;
use crate::error::{Error, Result};
use crate::kind::FileKind;
use crate::output::{Exit, print_line, printable, say};
use crate::webhook::fetch::{Fetched, Prefix};
use crate::webhook::http;
use crate::webhook::notification::{self, Object};
use crate::webhook::program::Program;

/// Where the store's token is taken from, if not from a file.
const TOKEN_VARIABLE: &str = "GUARDSPLAT_HOOK_TOKEN";
/// Shortest token that is taken.
const SHORTEST: usize = 16;

/// Arguments of `hook s3`.
#[derive(Args)]
pub struct Arguments {
    /// Address and port to listen on, for plain HTTP: put a server that speaks TLS before it
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8788")]
    listen: SocketAddr,
    /// File of the token that the store shows (`Authorization: Bearer`), 16 characters at least;
    /// GUARDSPLAT_HOOK_TOKEN goes before it
    #[arg(long, value_name = "FILE")]
    store_token_file: Option<PathBuf>,
    /// The bucket whose objects are marked; others are left alone
    #[arg(long, value_name = "NAME")]
    bucket: String,
    /// The folder that holds the bucket's objects, by their keys
    #[arg(
        long,
        value_name = "FOLDER",
        required_unless_present = "prefix",
        conflicts_with = "prefix"
    )]
    folder: Option<PathBuf>,
    /// The URL that the bucket's objects are under, by their keys, ending with /: they are fetched from there
    #[arg(long, value_name = "URL", value_parser = Prefix::parse)]
    prefix: Option<Prefix>,
    /// The key to mark with: keys/ID, its id, or its display name where no other key has the same
    #[arg(long, value_name = "KEY")]
    key: String,
    /// What to mark all of them with, in hexadecimal, as many bits as the key has
    #[arg(
        long,
        value_name = "HEX",
        required_unless_present = "program",
        conflicts_with = "program"
    )]
    message: Option<String>,
    /// How much work is spent
    #[arg(long, value_enum, default_value = "standard")]
    preset: Preset,
    /// A program and its arguments, after `--`, that prints the message for an object: `bucket`, `key`, `version` and
    /// `size` are on its standard input as JSON, and in GUARDSPLAT_BUCKET, GUARDSPLAT_OBJECT and GUARDSPLAT_VERSION. It
    /// must print the same for the same object, and nothing for one that is to be left alone. Where it does not exit with
    /// 0, it is asked again later
    #[arg(last = true, value_name = "PROGRAM")]
    program: Vec<String>,
}

/// What became of an object.
enum Outcome {
    /// There is a job for it.
    Job(String),
    /// There will never be one: why.
    Never(String),
}

/// Listens until it is interrupted.
pub async fn run(context: &Context, arguments: &Arguments) -> Result<Exit> {
    let token = token(arguments)?;
    let folder = match &arguments.folder {
        Some(folder) => Some(folder.canonicalize().map_err(Error::io(folder))?),
        None => None,
    };
    let key = key::find(context, &arguments.key).await?;
    if let Some(message) = &arguments.message {
        key::message(&key, message)?;
    }
    let doorkeeper = move |headers: &hyper::HeaderMap, _: &[u8]| {
        // Hashes are compared, so that timing tells nothing of the token.
        let shown: Option<[u8; 32]> = http::bearer(headers).map(|shown| Sha256::digest(shown.as_bytes()).into());
        (shown == Some(token)).then_some(()).ok_or_else(|| {
            say("refused a call: it shows another token, or none");
            StatusCode::UNAUTHORIZED
        })
    };
    let (address, mut calls) = http::listen(arguments.listen, Arc::new(doorkeeper)).await?;
    // For whoever started it with port 0.
    context.console.say(&format!("listening on http://{address}"));
    let program = Program::new(&arguments.program);
    while let Some(call) = calls.recv().await {
        let done = match notification::created(&call.body) {
            Ok(objects) => take(context, arguments, folder.as_deref(), &key, program.as_ref(), &objects).await,
            Err(reason) => {
                say(&format!("error: a notification can't be read: {}", printable(&reason)));
                false
            }
        };
        call.answer(done);
    }
    Ok(Exit::Done)
}

/// SHA-256 of the token that the store shows.
fn token(arguments: &Arguments) -> Result<[u8; 32]> {
    let variable = std::env::var(TOKEN_VARIABLE)
        .ok()
        .filter(|text| !text.trim().is_empty());
    let text = match (variable, &arguments.store_token_file) {
        (Some(text), _) => text,
        (None, Some(path)) => std::fs::read_to_string(path).map_err(Error::io(path))?,
        (None, None) => String::new(),
    };
    let text = text.trim();
    if text.len() < SHORTEST || text.contains(char::is_whitespace) {
        return Err(Error::BadOption {
            field: "--store-token-file",
            reason: format!("neither it nor {TOKEN_VARIABLE} has a token of {SHORTEST} characters or more"),
        });
    }
    Ok(Sha256::digest(text.as_bytes()).into())
}

/// Whether all objects of a notification are seen to: each has a job, or will never have one.
async fn take(
    context: &Context,
    arguments: &Arguments,
    folder: Option<&Path>,
    key: &Key,
    program: Option<&Program>,
    objects: &[Object],
) -> bool {
    let mut all = true;
    for object in objects {
        let name = printable(&format!("{}/{}", object.bucket, object.key));
        let outcome = match find(context, arguments, folder, object).await {
            Ok(Ok(found)) => submit(context, arguments, key, program, object, &found.path()).await,
            Ok(Err(reason)) => Ok(Outcome::Never(reason)),
            Err(error) => Err(error),
        };
        match outcome {
            Ok(Outcome::Job(job)) => print_line(&format!("{job}  {name}")),
            Ok(Outcome::Never(reason)) => say(&format!("left alone: {name}: {}", printable(&reason))),
            Err(error) => {
                say(&format!("error: {name}: {error}; the store will tell of it again"));
                all = false;
            }
        }
    }
    all
}

/// The file of an object.
enum Found {
    /// Where it is.
    Here(PathBuf),
    /// It was fetched.
    Fetched(Fetched),
}

impl Found {
    fn path(&self) -> PathBuf {
        match self {
            Self::Here(path) => path.clone(),
            Self::Fetched(fetched) => fetched.path(),
        }
    }
}

/// The file of an object, or why it will never have one.
async fn find(
    context: &Context,
    arguments: &Arguments,
    folder: Option<&Path>,
    object: &Object,
) -> Result<Result<Found, String>> {
    let never = |reason: &str| Ok(Err(reason.to_owned()));
    if object.bucket != arguments.bucket {
        return never("another bucket");
    }
    if Format::of_name(Path::new(&object.key)).is_none() {
        return never("not called a scene");
    }
    let Some(parts) = object.path() else {
        return never("a key that would lead to another folder");
    };
    if let Some(prefix) = &arguments.prefix {
        let fetched = prefix.fetch(&parts, context.server.timeout).await?;
        return Ok(Ok(Found::Fetched(fetched)));
    }
    let folder = folder.unwrap_or(Path::new("."));
    let path = parts.iter().fold(folder.to_owned(), |path, part| path.join(part));
    // A link may lead elsewhere, too.
    let real = path.canonicalize().map_err(Error::io(&path))?;
    if !real.starts_with(folder) {
        return never("a link to another folder");
    }
    Ok(Ok(Found::Here(real)))
}

async fn submit(
    context: &Context,
    arguments: &Arguments,
    key: &Key,
    program: Option<&Program>,
    object: &Object,
    path: &Path,
) -> Result<Outcome> {
    match FileKind::of(path) {
        Ok(FileKind::Scene(_)) => {}
        Ok(FileKind::Picture) => return Ok(Outcome::Never("a picture, and no scene".into())),
        Err(error) => return Ok(Outcome::Never(error.to_string())),
    }
    let message = match (program, &arguments.message) {
        (Some(program), _) => message(program, object).await?,
        (None, Some(message)) => message.clone(),
        (None, None) => String::new(), // one of both was asked for
    };
    if message.is_empty() {
        return Ok(Outcome::Never("the program has no message for it".into()));
    }
    let message = key::message(key, &message)?;
    let inputs = suspects::send(context, &[suspects::Input::File(path.to_owned())]).await?;
    let mut spec = EmbedSpec {
        // One input was given, and one name came back.
        scene: inputs.names.first().cloned().unwrap_or_default(),
        key: key.name.clone(),
        message,
        ..EmbedSpec::default()
    };
    spec.set_preset(arguments.preset.into());
    let submission = Submission {
        display_name: Some(title(&object.key)),
        priority: None,
        request_id: Some(object.request_id()),
        no_wait: true,
        cancel_on_interrupt: false,
    };
    match create_with(context, &submission, &inputs, Spec::Embed(spec)).await {
        Ok(job) => Ok(Outcome::Job(job.name)),
        // Nothing of it changes when it is asked for once more.
        Err(Error::Refused { status, .. })
            if matches!(
                status.code(),
                Code::InvalidArgument | Code::AlreadyExists | Code::FailedPrecondition
            ) =>
        {
            Ok(Outcome::Never(status.message().to_owned()))
        }
        Err(error) => Err(error),
    }
}

/// What the program says the object is to be marked with.
async fn message(program: &Program, object: &Object) -> Result<String> {
    let variables = [
        ("GUARDSPLAT_BUCKET", object.bucket.clone()),
        ("GUARDSPLAT_OBJECT", object.key.clone()),
        ("GUARDSPLAT_VERSION", object.version.clone()),
    ];
    // Structs with text for keys always have a JSON form.
    let input = serde_json::to_vec(object).unwrap_or_default();
    Ok(program.run(&input, &variables).await?.trim().to_owned())
}

/// The end of a key as the job's display name, which is the same whenever it is asked for.
fn title(key: &str) -> String {
    let shown: Vec<char> = key.chars().map(|c| if c.is_control() { '_' } else { c }).collect();
    shown[shown.len().saturating_sub(LONGEST_NAME)..].iter().collect()
}
