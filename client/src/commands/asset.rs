//! `asset create`, `asset list` and `asset show`.
use std::path::PathBuf;

use clap::{Args, Subcommand};
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::{Asset, CreateAssetRequest, GetAssetRequest, ListAssetsRequest};
use serde::Serialize;
use uuid::Uuid;

use super::{key, owner};
use crate::context::Context;
use crate::error::Result;
use crate::inputs;
use crate::options::LONGEST_NAME;
use crate::output::{Exit, print_json, print_line, printable};
use crate::pages;
use crate::report::AssetReport;
use crate::resource_names;
use crate::transfer::Source;

/// The commands on assets.
#[derive(Subcommand)]
pub enum Command {
    /// Registers an original by its SHA-256, and has the server sign that; nothing of it can be changed or deleted later
    Create(Create),
    /// Assets, newest first
    List(List),
    /// One asset
    Show {
        /// assets/ID, or the id alone
        asset: String,
    },
}

/// Arguments of `asset create`.
#[derive(Args)]
pub struct Create {
    /// The original, of which the SHA-256 is sent and nothing else; or one that is there already, artifacts/ID
    #[arg(value_name = "FILE")]
    original: String,
    /// Whose it is: owners/ID, its id, or its display name where no other owner has the same
    #[arg(long, value_name = "OWNER")]
    owner: String,
    /// The key that it is going to be marked with, which must have 64 bits for that: keys/ID, its id, or its display name
    #[arg(long, value_name = "KEY")]
    key: String,
    /// What people call it, at most 63 characters; the name of the file unless given
    #[arg(long, value_name = "TEXT")]
    display_name: Option<String>,
    /// Names this request: sent again with the same id, it gives the same asset; drawn at random unless given
    #[arg(long, value_name = "UUID")]
    request_id: Option<Uuid>,
}

/// Arguments of `asset list`.
#[derive(Args)]
pub struct List {
    /// Only those of this owner
    #[arg(long, value_name = "OWNER")]
    owner: Option<String>,
    /// Only those of this key
    #[arg(long, value_name = "KEY")]
    key: Option<String>,
    /// Most assets to list
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    limit: u32,
}

#[derive(Serialize)]
struct Listed {
    assets: Vec<AssetReport>,
    /// Whether there are more than were asked for.
    more: bool,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Create(arguments) => {
            let asset = create(context, arguments).await?;
            tell(context, &asset, &asset.name);
        }
        Command::List(arguments) => list(context, arguments).await?,
        Command::Show { asset } => {
            let request = GetAssetRequest {
                name: resource_names::asset(asset)?,
            };
            let sent = context.call("reading the asset", request, async |channel, request| {
                RegistryServiceClient::new(channel).get_asset(request).await
            });
            let asset = sent.await?;
            tell(context, &asset, &line(&asset));
        }
    }
    Ok(Exit::Done)
}

async fn create(context: &Context, arguments: &Create) -> Result<Asset> {
    let (original, title) = match inputs::Input::scene(&arguments.original) {
        inputs::Input::Artifact(name) => (Original::Artifact(name), String::new()),
        inputs::Input::File(path) => hashed(path).await?,
    };
    let owner = owner::find(context, &arguments.owner).await?.name;
    let key = key::find(context, &arguments.key).await?.name;
    let title = title.chars().filter(|c| !c.is_control()).take(LONGEST_NAME).collect();
    let request = CreateAssetRequest {
        asset: Some(Asset {
            owner,
            key,
            display_name: arguments.display_name.clone().unwrap_or(title),
            original: Some(original),
            ..Asset::default()
        }),
        // The same for every try, so that a lost answer does not make two assets.
        request_id: arguments.request_id.unwrap_or_else(Uuid::new_v4).to_string(),
    };
    let sent = context.call("registering the asset", request, async |channel, request| {
        RegistryServiceClient::new(channel).create_asset(request).await
    });
    sent.await
}

async fn hashed(path: PathBuf) -> Result<(Original, String)> {
    let source = Source::hash(&path).await?;
    Ok((Original::Sha256(source.sha256), source.display_name))
}

async fn list(context: &Context, arguments: &List) -> Result<()> {
    let owner = match &arguments.owner {
        Some(owner) => owner::find(context, owner).await?.name,
        None => String::new(),
    };
    let key = match &arguments.key {
        Some(key) => key::find(context, key).await?.name,
        None => String::new(),
    };
    let listed = pages::up_to(arguments.limit as usize, async |page_size, page_token| {
        let request = ListAssetsRequest {
            page_size,
            page_token,
            owner: owner.clone(),
            key: key.clone(),
        };
        let sent = context.call("listing assets", request, async |channel, request| {
            RegistryServiceClient::new(channel).list_assets(request).await
        });
        let page = sent.await?;
        Ok((page.assets, page.next_page_token))
    });
    let (assets, more) = listed.await?;
    if context.json {
        print_json(&Listed {
            assets: assets.iter().map(Into::into).collect(),
            more,
        });
        return Ok(());
    }
    assets.iter().for_each(|asset| print_line(&line(asset)));
    if assets.is_empty() {
        context.console.say("no assets");
    } else if more {
        context.console.say("there are more; --limit shows them");
    }
    Ok(())
}

fn tell(context: &Context, asset: &Asset, line: &str) {
    match context.json {
        true => print_json(&AssetReport::from(asset)),
        false => print_line(line),
    }
}

fn line(asset: &Asset) -> String {
    format!(
        "{}  {}  {}  number {}  {}",
        asset.name,
        asset.owner,
        asset.key,
        asset.payload_number,
        printable(&asset.display_name)
    )
}
