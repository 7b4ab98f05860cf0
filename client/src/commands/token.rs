//! `token create`, `token list` and `token revoke`.
use std::time::{Duration, SystemTime};

use clap::{Args, Subcommand};
use guardsplat_proto::v1::token::Scope;
use guardsplat_proto::v1::token_service_client::TokenServiceClient;
use guardsplat_proto::v1::{CreateTokenRequest, ListTokensRequest, RevokeTokenRequest, Token};
use serde::Serialize;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::options::display_name;
use crate::output::{Exit, print_json, print_line};
use crate::pages;
use crate::report::TokenReport;
use crate::resource_names;

/// The commands on tokens; a token with the scope admin is needed for them.
#[derive(Subcommand)]
pub enum Command {
    /// Makes a token, and prints it on standard output, this one time
    Create(Create),
    /// Tokens of the project, newest first, without their secrets
    List,
    /// Revokes a token at once and for good
    Revoke {
        /// Its name or id
        #[arg(value_name = "TOKEN")]
        token: String,
    },
}

/// Arguments of `token create`.
#[derive(Args)]
pub struct Create {
    /// What it is good for: embed, verify or admin; may be given several times
    #[arg(long = "scope", value_name = "SCOPE", required = true, value_parser = scope)]
    scopes: Vec<Scope>,
    /// When it ends, from now: such as 90d or 12h; never unless given
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    expires: Option<Duration>,
    /// What people call it, at most 63 characters
    #[arg(long, value_name = "TEXT", default_value = "", value_parser = display_name)]
    display_name: String,
}

fn scope(text: &str) -> Result<Scope, String> {
    match text {
        "embed" => Ok(Scope::Embed),
        "verify" => Ok(Scope::Verify),
        "admin" => Ok(Scope::Admin),
        "worker" => {
            Err("tokens for workers are made on the server's machine, by guardsplat-server token create".into())
        }
        _ => Err("must be embed, verify or admin".into()),
    }
}

#[derive(Serialize)]
struct Created {
    #[serde(flatten)]
    token: TokenReport,
    secret: String,
}

#[derive(Serialize)]
struct Listed {
    tokens: Vec<TokenReport>,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Create(arguments) => create(context, arguments).await,
        Command::List => list(context).await,
        Command::Revoke { token } => revoke(context, token).await,
    }
}

async fn create(context: &Context, arguments: &Create) -> Result<Exit> {
    let expire_time = arguments.expires.map(|time| {
        let end = SystemTime::now().checked_add(time);
        end.map(prost_types::Timestamp::from).ok_or_else(|| Error::BadOption {
            field: "--expires",
            reason: "is further away than time goes".into(),
        })
    });
    let token = Token {
        display_name: arguments.display_name.clone(),
        scopes: arguments.scopes.iter().map(|&scope| scope.into()).collect(),
        expire_time: expire_time.transpose()?,
        ..Token::default()
    };
    let request = CreateTokenRequest { token: Some(token) };
    // Once: a token whose text was lost on the way would be there, and of no use to anybody.
    let made = context.once("making the token", request, async |channel, request| {
        TokenServiceClient::new(channel).create_token(request).await
    });
    let made = made.await?;
    let token = made.token.ok_or_else(|| Error::Answer {
        reason: "it has no token".into(),
    })?;
    let report = TokenReport::from(&token);
    if context.json {
        print_json(&Created {
            token: report,
            secret: made.secret,
        });
        return Ok(Exit::Done);
    }
    print_line(&made.secret);
    context.console.say(&report.line());
    context
        .console
        .say("this is the one time that the token is shown; the server keeps its hash");
    Ok(Exit::Done)
}

async fn list(context: &Context) -> Result<Exit> {
    let tokens = pages::all(async |page_size, page_token| {
        let request = ListTokensRequest { page_size, page_token };
        let sent = context.call("listing tokens", request, async |channel, request| {
            TokenServiceClient::new(channel).list_tokens(request).await
        });
        let page = sent.await?;
        Ok((page.tokens, page.next_page_token))
    })
    .await?;
    let tokens: Vec<_> = tokens.iter().map(TokenReport::from).collect();
    if context.json {
        print_json(&Listed { tokens });
        return Ok(Exit::Done);
    }
    if tokens.is_empty() {
        context
            .console
            .say("no tokens yet: guardsplat token create --scope embed");
    }
    for token in &tokens {
        print_line(&token.line());
    }
    Ok(Exit::Done)
}

async fn revoke(context: &Context, token: &str) -> Result<Exit> {
    let request = RevokeTokenRequest {
        name: resource_names::token(token)?,
    };
    let sent = context.call("revoking the token", request, async |channel, request| {
        TokenServiceClient::new(channel).revoke_token(request).await
    });
    let report = TokenReport::from(&sent.await?);
    if context.json {
        print_json(&report);
    } else {
        print_line(&report.line());
    }
    Ok(Exit::Done)
}
