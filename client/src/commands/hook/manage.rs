//! `hook create`, `hook list`, `hook delete`, `hook deliveries` and `hook redeliver`.
use clap::{Args, ValueEnum};
use guardsplat_proto::v1::hook_service_client::HookServiceClient;
use guardsplat_proto::v1::{
    CreateHookRequest, DeleteHookRequest, Hook, ListDeliveriesRequest, ListHooksRequest, RedeliverDeliveryRequest,
    delivery, hook, job,
};
use serde::Serialize;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::options::display_name;
use crate::output::{Exit, print_json, print_line};
use crate::pages;
use crate::report::{DeliveryReport, HookReport};
use crate::resource_names;

/// What a job does.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Kind {
    /// Marks a scene
    Embed,
    /// Reads a suspect
    Verify,
    /// Makes a key
    CreateKey,
}

/// What became of a job.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum End {
    /// Done
    Succeeded,
    /// Given up
    Failed,
    /// Ended because somebody asked
    Cancelled,
}

/// What became of a delivery.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum State {
    /// To be sent, or on its way
    Pending,
    /// Acknowledged
    Delivered,
    /// Given up
    Dead,
}

/// Arguments of `hook create`.
#[derive(Args)]
pub struct Create {
    /// Where to send messages: https, unless the server allows http
    #[arg(value_name = "URL")]
    url: String,
    /// Kinds of jobs to be told of; all unless given
    #[arg(long = "kind", value_name = "KIND", value_enum)]
    kinds: Vec<Kind>,
    /// Ends to be told of; all unless given
    #[arg(long = "state", value_name = "STATE", value_enum)]
    states: Vec<End>,
    /// What people call it, at most 63 characters
    #[arg(long, value_name = "TEXT", default_value = "", value_parser = display_name)]
    display_name: String,
}

/// Arguments of `hook deliveries`.
#[derive(Args)]
pub struct Deliveries {
    /// Only those to this hook
    #[arg(long, value_name = "HOOK")]
    hook: Option<String>,
    /// Only those in this state
    #[arg(long, value_name = "STATE", value_enum)]
    state: Option<State>,
    /// Most of them
    #[arg(long, value_name = "NUMBER", default_value_t = 50)]
    limit: usize,
}

#[derive(Serialize)]
struct Created {
    #[serde(flatten)]
    hook: HookReport,
    secret: String,
}

#[derive(Serialize)]
struct Listed {
    hooks: Vec<HookReport>,
}

#[derive(Serialize)]
struct DeliveryList {
    deliveries: Vec<DeliveryReport>,
}

/// Registers a URL.
pub async fn create(context: &Context, arguments: &Create) -> Result<Exit> {
    let kind = |kind: &Kind| match kind {
        Kind::Embed => hook::Kind::Embed,
        Kind::Verify => hook::Kind::Verify,
        Kind::CreateKey => hook::Kind::CreateKey,
    };
    let end = |end: &End| match end {
        End::Succeeded => job::State::Succeeded,
        End::Failed => job::State::Failed,
        End::Cancelled => job::State::Cancelled,
    };
    let hook = Hook {
        display_name: arguments.display_name.clone(),
        url: arguments.url.clone(),
        kinds: arguments.kinds.iter().map(|each| kind(each).into()).collect(),
        states: arguments.states.iter().map(|each| end(each).into()).collect(),
        ..Hook::default()
    };
    let request = CreateHookRequest { hook: Some(hook) };
    // Once: a hook whose secret was lost on the way would be there, and of no use to anybody.
    let made = context.once("making the hook", request, async |channel, request| {
        HookServiceClient::new(channel).create_hook(request).await
    });
    let made = made.await?;
    let hook = made.hook.ok_or_else(|| Error::Answer {
        reason: "it has no hook".into(),
    })?;
    let report = HookReport::from(&hook);
    if context.json {
        print_json(&Created {
            hook: report,
            secret: made.secret,
        });
        return Ok(Exit::Done);
    }
    print_line(&made.secret);
    context.console.say(&report.line());
    context
        .console
        .say("this is the one time that the secret is shown; receivers check signatures with it");
    Ok(Exit::Done)
}

/// Prints all hooks.
pub async fn list(context: &Context) -> Result<Exit> {
    let hooks = pages::all(async |page_size, page_token| {
        let request = ListHooksRequest { page_size, page_token };
        let sent = context.call("listing hooks", request, async |channel, request| {
            HookServiceClient::new(channel).list_hooks(request).await
        });
        let page = sent.await?;
        Ok((page.hooks, page.next_page_token))
    })
    .await?;
    let hooks: Vec<_> = hooks.iter().map(HookReport::from).collect();
    if context.json {
        print_json(&Listed { hooks });
    } else {
        for hook in &hooks {
            print_line(&hook.line());
        }
    }
    Ok(Exit::Done)
}

/// Deletes one.
pub async fn delete(context: &Context, text: &str) -> Result<Exit> {
    let name = resource_names::hook(text)?;
    let request = DeleteHookRequest { name: name.clone() };
    let deleted = context.once("deleting the hook", request, async |channel, request| {
        HookServiceClient::new(channel).delete_hook(request).await
    });
    deleted.await?;
    context.console.say(&format!("{name} is deleted"));
    Ok(Exit::Done)
}

/// Prints deliveries.
pub async fn deliveries(context: &Context, arguments: &Deliveries) -> Result<Exit> {
    let state = match arguments.state {
        None => delivery::State::Unspecified,
        Some(State::Pending) => delivery::State::Pending,
        Some(State::Delivered) => delivery::State::Delivered,
        Some(State::Dead) => delivery::State::Dead,
    };
    let hook = arguments
        .hook
        .as_deref()
        .map(resource_names::hook)
        .transpose()?
        .unwrap_or_default();
    let listed = pages::up_to(arguments.limit, async |page_size, page_token| {
        let request = ListDeliveriesRequest {
            hook: hook.clone(),
            state: state.into(),
            page_size,
            page_token,
        };
        let sent = context.call("listing deliveries", request, async |channel, request| {
            HookServiceClient::new(channel).list_deliveries(request).await
        });
        let page = sent.await?;
        Ok((page.deliveries, page.next_page_token))
    });
    let (deliveries, _) = listed.await?;
    let deliveries: Vec<_> = deliveries.iter().map(DeliveryReport::from).collect();
    if context.json {
        print_json(&DeliveryList { deliveries });
    } else {
        for delivery in &deliveries {
            print_line(&delivery.line());
        }
    }
    Ok(Exit::Done)
}

/// Has one sent again.
pub async fn redeliver(context: &Context, text: &str) -> Result<Exit> {
    let request = RedeliverDeliveryRequest {
        name: resource_names::delivery(text)?,
    };
    let again = context.call("sending the delivery again", request, async |channel, request| {
        HookServiceClient::new(channel).redeliver_delivery(request).await
    });
    let report = DeliveryReport::from(&again.await?);
    if context.json {
        print_json(&report);
    } else {
        print_line(&report.line());
    }
    Ok(Exit::Done)
}
