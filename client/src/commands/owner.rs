//! `owner create`, `owner list` and `owner show`, and which owner a name means.
use clap::Subcommand;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::{CreateOwnerRequest, GetOwnerRequest, ListOwnersRequest, Owner};
use serde::Serialize;
use uuid::Uuid;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::output::{Exit, print_json, print_line, printable};
use crate::pages;
use crate::report::OwnerReport;
use crate::resource_names;

/// The commands on owners.
#[derive(Subcommand)]
pub enum Command {
    /// Registers a person or a company; nothing of it can be changed or deleted later
    Create {
        /// What people call it, at most 63 characters
        #[arg(value_name = "NAME")]
        display_name: String,
    },
    /// Owners, newest first
    List,
    /// One owner
    Show {
        /// owners/ID, its id, or its display name where no other owner has the same
        owner: String,
    },
}

#[derive(Serialize)]
struct Listed {
    owners: Vec<OwnerReport>,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Create { display_name } => {
            let owner = create(context, display_name).await?;
            tell(context, &owner, &owner.name);
        }
        Command::List => {
            let owners = all(context).await?;
            if context.json {
                print_json(&Listed {
                    owners: owners.iter().map(Into::into).collect(),
                });
                return Ok(Exit::Done);
            }
            if owners.is_empty() {
                context.console.say("no owners yet: guardsplat owner create NAME");
            }
            owners.iter().for_each(|owner| print_line(&line(owner)));
        }
        Command::Show { owner } => {
            let owner = find(context, owner).await?;
            tell(context, &owner, &line(&owner));
        }
    }
    Ok(Exit::Done)
}

fn tell(context: &Context, owner: &Owner, line: &str) {
    match context.json {
        true => print_json(&OwnerReport::from(owner)),
        false => print_line(line),
    }
}

fn line(owner: &Owner) -> String {
    format!("{}  {}", owner.name, printable(&owner.display_name))
}

async fn create(context: &Context, display_name: &str) -> Result<Owner> {
    let request = CreateOwnerRequest {
        owner: Some(Owner {
            display_name: display_name.to_owned(),
            ..Owner::default()
        }),
        // The same for every try, so that a lost answer does not make two owners.
        request_id: Uuid::new_v4().to_string(),
    };
    let sent = context.call("registering the owner", request, async |channel, request| {
        RegistryServiceClient::new(channel).create_owner(request).await
    });
    sent.await
}

/// The owner that `text` means: its name, its id, or a display name that only one owner has.
pub async fn find(context: &Context, text: &str) -> Result<Owner> {
    if let Some(name) = resource_names::owner(text) {
        let sent = context.call(
            "reading the owner",
            GetOwnerRequest { name },
            async |channel, request| RegistryServiceClient::new(channel).get_owner(request).await,
        );
        return sent.await;
    }
    let mut found = all(context).await?;
    found.retain(|owner| owner.display_name == text);
    let wrong = |reason: String| Error::BadOption { field: "OWNER", reason };
    match (found.pop(), found.len()) {
        (Some(owner), 0) => Ok(owner),
        (None, _) => Err(wrong(format!(
            "there is no owner `{text}`; guardsplat owner list shows those there are"
        ))),
        (Some(_), others) => Err(wrong(format!(
            "{} owners are called `{text}`: name one by owners/ and its id",
            others + 1
        ))),
    }
}

async fn all(context: &Context) -> Result<Vec<Owner>> {
    pages::all(async |page_size, page_token| {
        let request = ListOwnersRequest { page_size, page_token };
        let sent = context.call("listing owners", request, async |channel, request| {
            RegistryServiceClient::new(channel).list_owners(request).await
        });
        let page = sent.await?;
        Ok((page.owners, page.next_page_token))
    })
    .await
}
