//! Puts the layers together.
use std::collections::HashMap;
use std::path::PathBuf;

use config::builder::DefaultState;
use config::{Config, ConfigBuilder, ConfigError, Environment, File, FileFormat};
use secrecy::SecretString;

use super::database::without_urls;
use super::{Flags, Settings, SettingsError};
use crate::secrets::MASTER_KEY_VARIABLE;

/// Read when it is there and no other file is named.
const USUAL_FILE: &str = "/etc/guardsplat/server.toml";
/// What the names of environment variables begin with.
const PREFIX: &str = "GUARDSPLAT_";
/// Variables with this beginning that other programs of the project read, so that one environment serves them all.
const OTHERS: &[&str] = &[
    "CA",
    "CERT",
    "CERT_KEY",
    "CLIP",
    "CONFIG",
    "CREDENTIALS_ALGORITHM",
    "CREDENTIALS_CERTIFICATE",
    "CREDENTIALS_PRIVATE_KEY",
    "HOME",
    "HOOK_SECRET",
    "HOOK_TOKEN",
    "HOOK_TRY",
    "KEY",
    "MODELS",
    "SCENES",
    "SERVER",
    "TOKEN",
    "TOKEN_FILE",
];

/// Loads all layers and checks them. The environment is an argument so that tests can have their own.
pub fn load(flags: Flags, environment: impl IntoIterator<Item = (String, String)>) -> Result<Settings, SettingsError> {
    let mut master_key = None;
    let mut variables = HashMap::new();
    for (name, value) in environment {
        // An empty variable is how one is unset in many places.
        if value.trim().is_empty() {
            continue;
        }
        if name == MASTER_KEY_VARIABLE {
            master_key = Some(SecretString::from(value));
        } else if let Some(setting) = name.strip_prefix(PREFIX).filter(|name| !is_of_others(name)) {
            variables.insert(setting.to_lowercase(), value);
        }
    }
    let mut builder = Config::builder();
    if let Some(path) = flags.config.clone().or_else(usual_file) {
        builder = builder.add_source(File::from(path).format(FileFormat::Toml));
    }
    let mut settings = build(builder.add_source(Environment::default().source(Some(variables))))?;
    flags.apply(&mut settings);
    settings.master_key = master_key;
    settings.check()?;
    Ok(settings)
}

/// The settings of a file alone, from its text.
pub fn parse(text: &str) -> Result<Settings, SettingsError> {
    let settings = build(Config::builder().add_source(File::from_str(text, FileFormat::Toml)))?;
    settings.check()?;
    Ok(settings)
}

fn build(layers: ConfigBuilder<DefaultState>) -> Result<Settings, SettingsError> {
    let settings = layers.build().and_then(Config::try_deserialize);
    settings.map_err(|error: ConfigError| SettingsError::Unreadable(without_urls(&error.to_string())))
}

fn usual_file() -> Option<PathBuf> {
    Some(PathBuf::from(USUAL_FILE)).filter(|path| path.exists())
}

/// Whether a variable is not meant for the server. Besides those of other programs, these are the ones that Kubernetes
/// and Docker set for a service by the name of `guardsplat`, such as `GUARDSPLAT_SERVICE_HOST`.
fn is_of_others(name: &str) -> bool {
    let from_service = name.contains("SERVICE_HOST") || name.contains("SERVICE_PORT");
    let from_port = name == "PORT" || name.starts_with("PORT_") || name.contains("_PORT_") || name.ends_with("_PORT");
    OTHERS.contains(&name) || from_service || from_port
}
