//! `key create` and `key list`, and which key a name means.
use clap::{Args, Subcommand};
use guardsplat_codeword::{MAX_BITS, Message};
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::key_service_client::KeyServiceClient;
use guardsplat_proto::v1::{GetKeyRequest, Key, KeySpec, ListKeysRequest};
use serde::Serialize;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::job::create::{create, leave, no_result, succeeded, wait};
use crate::options::Submission;
use crate::output::{Exit, print_json, print_line, printable};
use crate::pages;
use crate::report::{KeyReport, KeyResultReport};
use crate::resource_names;

/// The commands on keys.
#[derive(Subcommand)]
pub enum Command {
    /// Has a key made and its decoder trained; its secret stays with the server
    Create(Create),
    /// Keys, newest first
    List,
}

/// Arguments of `key create`.
#[derive(Args)]
pub struct Create {
    /// Bits of its messages, 1 to 150
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_BITS)))]
    bits: u32,
    /// Makes the key reproducible, and no more secret than this number; without it, it is drawn at random
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
    #[command(flatten)]
    submission: Submission,
}

#[derive(Serialize)]
struct Created<'a> {
    job: &'a str,
    #[serde(flatten)]
    result: KeyResultReport,
    display_name: &'a str,
    bits: u32,
    clip: &'a str,
    clip_sha256: &'a str,
    seeded: bool,
}

#[derive(Serialize)]
struct Listed {
    keys: Vec<KeyReport>,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Create(arguments) => make(context, arguments).await,
        Command::List => list(context).await,
    }
}

async fn make(context: &Context, arguments: &Create) -> Result<Exit> {
    let spec = Spec::CreateKey(KeySpec {
        bits: arguments.bits,
        seed: arguments.seed,
        ..KeySpec::default()
    });
    let job = create(context, &arguments.submission, "", spec).await?;
    if arguments.submission.no_wait {
        leave(context, &job);
        return Ok(Exit::Done);
    }
    let job = succeeded(wait(context, &arguments.submission, &job).await?)?;
    let Some(Outcome::KeyResult(result)) = &job.result else {
        return Err(no_result(&job));
    };
    let report = KeyResultReport::from(result);
    if !context.json {
        print_line(&report.line());
        return Ok(Exit::Done);
    }
    let key = get(context, result.key.clone()).await?;
    print_json(&Created {
        job: &job.name,
        result: report,
        display_name: &key.display_name,
        bits: key.bits,
        clip: &key.clip,
        clip_sha256: &key.clip_sha256,
        seeded: key.seeded,
    });
    Ok(Exit::Done)
}

async fn list(context: &Context) -> Result<Exit> {
    let keys = all(context).await?;
    if context.json {
        print_json(&Listed {
            keys: keys.iter().map(Into::into).collect(),
        });
        return Ok(Exit::Done);
    }
    if keys.is_empty() {
        context.console.say("no keys yet: guardsplat key create --bits 32");
    }
    for key in &keys {
        print_line(&format!(
            "{}  {:>2} bits  {}{}  {}",
            key.name,
            key.bits,
            printable(&key.clip),
            if key.seeded { "  from a seed" } else { "" },
            printable(&key.display_name)
        ));
    }
    Ok(Exit::Done)
}

/// The key that `text` means: its name, its id, or a display name that only one key has.
pub async fn find(context: &Context, text: &str) -> Result<Key> {
    if let Some(name) = resource_names::key(text) {
        return get(context, name).await;
    }
    let mut found = all(context).await?;
    found.retain(|key| !text.is_empty() && key.display_name == text);
    match (found.pop(), found.len()) {
        (Some(key), 0) => Ok(key),
        (None, _) => Err(wrong(format!(
            "there is no key `{text}`; guardsplat key list shows those there are"
        ))),
        (Some(_), others) => Err(wrong(format!(
            "{} keys are called `{text}`: name one by keys/ and its id",
            others + 1
        ))),
    }
}

fn wrong(reason: String) -> Error {
    Error::BadOption { field: "--key", reason }
}

/// The message as the server is sent it, in lower case and without `0x`. It must have the length that the key wants,
/// which is better known before anything large is sent.
pub fn message(key: &Key, given: &str) -> Result<String> {
    let message = Message::parse(given, key.bits as usize).map_err(|error| Error::BadOption {
        field: "--message",
        reason: format!(
            "must be {} hexadecimal digits, for the {} bits of {} ({error})",
            key.bits.div_ceil(4),
            key.bits,
            key.name
        ),
    })?;
    Ok(message.to_string())
}

async fn get(context: &Context, name: String) -> Result<Key> {
    let sent = context.call("reading the key", GetKeyRequest { name }, async |channel, request| {
        KeyServiceClient::new(channel).get_key(request).await
    });
    sent.await
}

async fn all(context: &Context) -> Result<Vec<Key>> {
    pages::all(async |page_size, page_token| {
        let request = ListKeysRequest { page_size, page_token };
        let sent = context.call("listing keys", request, async |channel, request| {
            KeyServiceClient::new(channel).list_keys(request).await
        });
        let page = sent.await?;
        Ok((page.keys, page.next_page_token))
    })
    .await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_must_fit_the_key() {
        let key = |bits| Key { bits, ..Key::default() };
        assert_eq!(message(&key(32), "c0ffee42").unwrap(), "c0ffee42");
        assert_eq!(message(&key(30), "00FFEE42").unwrap(), "00ffee42");
        assert_eq!(message(&key(33), "0X0c0ffee42").unwrap(), "0c0ffee42");
        let wrong = message(&key(32), "c0ffee4").unwrap_err().to_string();
        assert!(wrong.contains("--message: must be 8 hexadecimal digits"), "{wrong}");
        assert!(message(&key(32), "c0ffee4x").is_err());
        assert!(message(&key(32), "0xc0ffee").is_err());
        assert!(message(&key(32), "").is_err());
        assert!(message(&key(30), "f0ffee42").is_err());
    }
}
