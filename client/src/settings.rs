//! Where the server is, how it is reached and how long it is waited for: defaults, a file, the environment, flags.
use std::path::{Path, PathBuf};
use std::time::Duration;

use guardsplat_proto::connect::{TOKEN_VARIABLE, Target, Token};
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::options::Global;

/// Where the server listens unless told otherwise.
pub const DEFAULT_SERVER: &str = "http://127.0.0.1:50051";
/// How long a silent or lost server is waited for unless told otherwise.
const DEFAULT_TIMEOUT_SECONDS: u64 = 60;
/// Longest time to wait for a server.
const MOST_SECONDS: u64 = 86_400;

/// What the commands need to know.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The server.
    pub target: Target,
    /// How long a silent or lost server is waited for.
    pub timeout: Duration,
}

/// The configuration file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    server: Option<String>,
    timeout: Option<u64>,
    ca: Option<PathBuf>,
    cert: Option<PathBuf>,
    cert_key: Option<PathBuf>,
    token_file: Option<PathBuf>,
}

impl Settings {
    /// Flags and environment (which clap has merged) over the file over the defaults.
    pub fn load(global: &Global) -> Result<Self> {
        let file = match &global.config {
            Some(path) => read(path)?,
            None => match usual_file() {
                Some(path) if path.is_file() => read(&path)?,
                _ => File::default(),
            },
        };
        // An empty variable is how one is unset in many places.
        let given = global.server.clone().filter(|server| !server.trim().is_empty());
        let server = given.or(file.server).unwrap_or_else(|| DEFAULT_SERVER.into());
        let path = |given: &Option<PathBuf>, file| given.clone().filter(|path| !path.as_os_str().is_empty()).or(file);
        let token_file = path(&global.token_file, file.token_file);
        let variable = std::env::var(TOKEN_VARIABLE).ok();
        let token = Token::find(variable.as_deref(), token_file.as_deref()).map_err(|error| Error::BadOption {
            field: "--token-file",
            reason: error.to_string(),
        })?;
        let seconds = global.timeout.or(file.timeout).unwrap_or(DEFAULT_TIMEOUT_SECONDS);
        Ok(Self {
            target: Target {
                url: server.trim_end_matches('/').to_owned(),
                ca: path(&global.ca, file.ca),
                certificate: path(&global.cert, file.cert),
                certificate_key: path(&global.cert_key, file.cert_key),
                token,
            },
            timeout: Duration::from_secs(seconds),
        })
    }
}

fn read(path: &Path) -> Result<File> {
    let bad = |reason: String| Error::Settings {
        path: path.to_owned(),
        reason,
    };
    let text = std::fs::read_to_string(path).map_err(|e| bad(e.to_string()))?;
    let file: File = config::Config::builder()
        .add_source(config::File::from_str(&text, config::FileFormat::Toml))
        .build()
        .and_then(config::Config::try_deserialize)
        .map_err(|e| bad(e.to_string()))?;
    if file.timeout.is_some_and(|s| !(1..=MOST_SECONDS).contains(&s)) {
        return Err(bad(format!("timeout must be 1 to {MOST_SECONDS} seconds")));
    }
    Ok(file)
}

/// Where the file is looked for when no flag names it.
fn usual_file() -> Option<PathBuf> {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty());
    let folder = match set("XDG_CONFIG_HOME") {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(set("HOME")?).join(".config"),
    };
    Some(folder.join("guardsplat/client.toml"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(text: &str, server: Option<&str>, timeout: Option<u64>) -> Result<Settings> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Settings::load(&Global {
            server: server.map(Into::into),
            config: Some(file.path().into()),
            timeout,
            ..Global::default()
        })
    }

    #[test]
    fn flags_win_over_the_file_and_the_file_over_defaults() {
        let settings = load("server = \"http://a:1\"\ntimeout = 5", None, None).unwrap();
        assert_eq!(settings.target.url, "http://a:1");
        assert_eq!(settings.timeout, Duration::from_secs(5));
        let settings = load("server = \"http://a:1\"\ntimeout = 5", Some("http://b:2"), Some(7)).unwrap();
        assert_eq!(settings.target.url, "http://b:2");
        assert_eq!(settings.timeout, Duration::from_secs(7));
        let unset = load("server = \"http://a:1\"", Some(""), None).unwrap();
        assert_eq!(unset.target.url, "http://a:1");
        let settings = load("", None, None).unwrap();
        assert_eq!(settings.target.url, DEFAULT_SERVER);
        assert_eq!(settings.timeout, Duration::from_secs(60));
    }

    #[test]
    fn what_tls_needs_comes_from_the_file_and_flags_go_before_it() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "ca = \"a.pem\"\ncert = \"c.pem\"\ncert_key = \"k.pem\"").unwrap();
        let settings = Settings::load(&Global {
            config: Some(file.path().into()),
            ca: Some("b.pem".into()),
            cert: Some("".into()),
            ..Global::default()
        });
        let target = settings.unwrap().target;
        assert_eq!(target.ca, Some("b.pem".into()));
        assert_eq!(
            (target.certificate, target.certificate_key),
            (Some("c.pem".into()), Some("k.pem".into()))
        );
    }

    #[test]
    fn mistakes_in_the_file_are_told() {
        let wrong = |text| load(text, None, None).unwrap_err().to_string();
        assert!(wrong("sever = 1").contains("sever"), "{}", wrong("sever = 1"));
        assert!(wrong("timeout = 0").contains("1 to 86400"));
        assert!(wrong("timeout = \"soon\"").contains("timeout"));
    }

    #[test]
    fn a_file_that_was_named_must_be_there() {
        let missing = Settings::load(&Global {
            config: Some("/nonexistent/client.toml".into()),
            ..Global::default()
        });
        assert!(missing.unwrap_err().to_string().contains("/nonexistent/client.toml"));
    }
}
