//! `guardsplat-server token`: tokens made, listed and revoked on the server's machine, on the ledger itself. It is the
//! way in where there is no token yet, and it works beside a server that runs.
use std::fs::DirBuilder;
use std::os::unix::fs::DirBuilderExt;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};
use secrecy::ExposeSecret;
use uuid::Uuid;

use crate::access::{self, DEFAULT_PROJECT, Scope, Scopes, check_project};
use crate::backup;
use crate::error::{Error, Result};
use crate::ledger::{NewToken, TokenLedger, TokenRow};
use crate::notary::Notary;
use crate::run::{DataFolder, ledger, startup, store};
use crate::secrets;
use crate::service::{clock, text};
use crate::settings::Settings;

/// Tokens read at a time.
const PAGE: u32 = 1000;

/// What there is to do besides serving.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Tokens: who may call, for which project, and what
    #[command(subcommand)]
    Token(Token),
    /// The store of artifacts: whose it is
    #[command(subcommand)]
    Store(Store),
    /// Copies all that the server keeps to a folder, also while it runs; the master key only if that is asked for
    Backup {
        /// A folder that is empty or not there yet
        #[arg(value_name = "FOLDER")]
        to: PathBuf,
        /// Puts the master key beside it; whoever has both reads every key file
        #[arg(long)]
        with_master_key: bool,
    },
    /// Makes the data folder, which must be empty or not there yet, of a backup
    Restore {
        /// The folder that `backup` made
        #[arg(value_name = "FOLDER")]
        from: PathBuf,
    },
}

/// What there is to do with tokens.
#[derive(Clone, Debug, Subcommand)]
pub enum Token {
    /// Makes a token, and prints it on standard output, this one time
    Create(Create),
    /// Prints the tokens there are, newest first, without their secrets
    List {
        /// Only those of this project
        #[arg(long, value_name = "NAME")]
        project: Option<String>,
    },
    /// Revokes a token at once and for good
    Revoke {
        /// Its id, or tokens/ and its id
        #[arg(value_name = "TOKEN")]
        name: String,
    },
}

/// What there is to do with the store of artifacts.
#[derive(Clone, Debug, Subcommand)]
pub enum Store {
    /// Takes the store for this ledger, though it went on with another copy of it. What came to it since is deleted as
    /// bytes that nothing points at, so first stop whatever else uses it
    TakeOver,
}

/// Arguments of `token create`.
#[derive(Clone, Debug, Args)]
pub struct Create {
    /// Whose everything is that is made with it: small letters, digits and hyphens
    #[arg(long, value_name = "NAME", default_value = DEFAULT_PROJECT)]
    project: String,
    /// What it is good for; may be given several times
    #[arg(long = "scope", value_name = "SCOPE", required = true)]
    scopes: Vec<Scope>,
    /// When it ends, from now: such as 90d or 12h; never unless given
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    expires: Option<Duration>,
    /// What people call it, at most 63 characters
    #[arg(long, value_name = "TEXT", default_value = "")]
    display_name: String,
}

/// What came of it: lines for standard output, and for standard error.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Said {
    /// What was asked for.
    pub out: Vec<String>,
    /// What else people want to know.
    pub err: Vec<String>,
}

/// Carries out a command on the ledger of these settings.
pub async fn run(settings: &Settings, command: Command) -> Result<Said> {
    let command = match command {
        Command::Token(command) => command,
        Command::Backup { to, with_master_key } => return backup::take(settings, &to, with_master_key).await,
        Command::Restore { from } => return backup::restore(settings, &from).await,
        Command::Store(Store::TakeOver) => return take_over(settings).await,
    };
    let folder = &settings.data_dir;
    let failed = |error: std::io::Error| Error::Startup(format!("data_dir {}: {error}", folder.display()));
    if settings.database.is_none() {
        // Others than its owner have no business in it, whoever makes it first.
        DirBuilder::new()
            .recursive(true)
            .mode(0o700)
            .create(folder)
            .map_err(failed)?;
    }
    let ledger = ledger::open(settings, folder).await.map_err(startup)?;
    let said = match command {
        Token::Create(arguments) => create(&*ledger, arguments).await,
        Token::List { project } => list(&*ledger, project.as_deref()).await,
        Token::Revoke { name } => revoke(&*ledger, &name).await,
    };
    ledger.close().await;
    said
}

/// Needs the data folder, so no server may be running on it.
async fn take_over(settings: &Settings) -> Result<Said> {
    let folder = DataFolder::open(&settings.data_dir)?;
    let master = secrets::load(settings.key_source(), folder.path()).map_err(startup)?;
    let store = store::open(settings, folder.path()).await?;
    let ledger = ledger::open(settings, folder.path()).await.map_err(startup)?;
    let taken = async {
        let notary = Notary::open(&*ledger, &master, clock::now()).await.map_err(startup)?;
        store::take_over(&store, &notary, &*ledger, clock::now()).await
    };
    let taken = taken.await;
    ledger.close().await;
    taken?;
    Ok(Said {
        out: vec![format!("{} is this ledger's", store.place())],
        err: Vec::new(),
    })
}

async fn create(ledger: &dyn TokenLedger, arguments: Create) -> Result<Said> {
    check_project("--project", &arguments.project)?;
    text::display_name("--display-name", &arguments.display_name)?;
    let now = clock::now();
    let length = arguments
        .expires
        .map(|time| i64::try_from(time.as_micros()).unwrap_or(i64::MAX));
    if length == Some(0) {
        return Err(Error::invalid("--expires", "must be longer than nothing"));
    }
    let fresh = access::fresh()?;
    let new = NewToken {
        id: fresh.id,
        hash: fresh.hash,
        display_name: arguments.display_name,
        project: arguments.project,
        scopes: arguments.scopes.into_iter().collect::<Scopes>(),
        expire_time: length.map(|length| now.saturating_add(length)),
    };
    let row = ledger.create_token(new, now).await?;
    Ok(Said {
        out: vec![fresh.text.expose_secret().to_owned()],
        err: vec![
            line(&row),
            "this is the one time that the token is shown; the server keeps its hash".into(),
        ],
    })
}

async fn list(ledger: &dyn TokenLedger, project: Option<&str>) -> Result<Said> {
    let mut said = Said::default();
    let mut before = None;
    loop {
        let page = ledger.list_tokens(project, before, PAGE).await?;
        let Some(last) = page.last() else { break };
        before = Some((last.create_time, last.id));
        said.out.extend(page.iter().map(line));
    }
    if said.out.is_empty() {
        said.err
            .push("no tokens yet: guardsplat-server token create --scope admin".into());
    }
    Ok(said)
}

async fn revoke(ledger: &dyn TokenLedger, name: &str) -> Result<Said> {
    let id = name.strip_prefix("tokens/").unwrap_or(name);
    let id =
        Uuid::try_parse(id).map_err(|_| Error::invalid("TOKEN", "must be the id of a token, or tokens/ and it"))?;
    let row = ledger.revoke_token(id, clock::now()).await?;
    Ok(Said {
        out: vec![line(&row)],
        err: Vec::new(),
    })
}

/// A token for people.
fn line(row: &TokenRow) -> String {
    let time = |micros: i64| {
        let time = std::time::UNIX_EPOCH + Duration::from_micros(u64::try_from(micros).unwrap_or_default());
        humantime::format_rfc3339_seconds(time).to_string()
    };
    let mut line = format!(
        "tokens/{}  {}  {}  made {}",
        row.id,
        row.project,
        row.scopes,
        time(row.create_time)
    );
    for (word, at) in [
        ("ends", row.expire_time),
        ("last used", row.last_use_time),
        ("revoked", row.revoke_time),
    ] {
        if let Some(at) = at {
            line += &format!("  {word} {}", time(at));
        }
    }
    if !row.display_name.is_empty() {
        line += &format!("  {}", row.display_name);
    }
    line
}
