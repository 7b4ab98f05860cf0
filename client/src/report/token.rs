//! Tokens, without their secrets.
use guardsplat_proto::v1::Token;
use serde::Serialize;

use super::text::{time, word};
use crate::output::printable;

/// What is known of a token.
#[derive(Debug, Serialize)]
pub struct TokenReport {
    name: String,
    display_name: String,
    project: String,
    scopes: Vec<String>,
    create_time: Option<String>,
    expire_time: Option<String>,
    last_use_time: Option<String>,
    revoke_time: Option<String>,
}

impl From<&Token> for TokenReport {
    fn from(token: &Token) -> Self {
        Self {
            name: token.name.clone(),
            display_name: token.display_name.clone(),
            project: token.project.clone(),
            scopes: token
                .scopes()
                .map(|scope| word(scope.as_str_name(), "SCOPE_"))
                .collect(),
            create_time: time(token.create_time),
            expire_time: time(token.expire_time),
            last_use_time: time(token.last_use_time),
            revoke_time: time(token.revoke_time),
        }
    }
}

impl TokenReport {
    /// For people.
    pub fn line(&self) -> String {
        let mut line = format!("{}  {}", printable(&self.name), self.scopes.join(", "));
        for (word, time) in [
            ("ends", &self.expire_time),
            ("last used", &self.last_use_time),
            ("revoked", &self.revoke_time),
        ] {
            if let Some(time) = time {
                line += &format!("  {word} {time}");
            }
        }
        format!("{line}  {}", printable(&self.display_name))
            .trim_end()
            .to_owned()
    }
}
