//! Hooks, without their secrets, and deliveries.
use guardsplat_proto::v1::{Delivery, Hook};
use serde::Serialize;

use super::text::{some, time, word};
use crate::output::printable;

/// What is known of a hook.
#[derive(Debug, Serialize)]
pub struct HookReport {
    name: String,
    display_name: String,
    project: String,
    url: String,
    kinds: Vec<String>,
    states: Vec<String>,
    create_time: Option<String>,
}

impl From<&Hook> for HookReport {
    fn from(hook: &Hook) -> Self {
        Self {
            name: hook.name.clone(),
            display_name: hook.display_name.clone(),
            project: hook.project.clone(),
            url: hook.url.clone(),
            kinds: hook.kinds().map(|kind| word(kind.as_str_name(), "KIND_")).collect(),
            states: hook.states().map(|state| word(state.as_str_name(), "STATE_")).collect(),
            create_time: time(hook.create_time),
        }
    }
}

impl HookReport {
    /// For people.
    pub fn line(&self) -> String {
        let all = |words: &[String]| match words {
            [] => "all".to_owned(),
            words => words.join(", "),
        };
        format!(
            "{}  {}  {} jobs  {} ends  {}",
            printable(&self.name),
            printable(&self.url),
            all(&self.kinds),
            all(&self.states),
            printable(&self.display_name)
        )
        .trim_end()
        .to_owned()
    }
}

/// What is known of a delivery.
#[derive(Debug, Serialize)]
pub struct DeliveryReport {
    name: String,
    hook: String,
    job: String,
    r#type: String,
    state: String,
    attempts: i32,
    last_error: Option<String>,
    create_time: Option<String>,
    last_attempt_time: Option<String>,
    next_attempt_time: Option<String>,
    end_time: Option<String>,
}

impl From<&Delivery> for DeliveryReport {
    fn from(delivery: &Delivery) -> Self {
        Self {
            name: delivery.name.clone(),
            hook: delivery.hook.clone(),
            job: delivery.job.clone(),
            r#type: delivery.r#type.clone(),
            state: word(delivery.state().as_str_name(), "STATE_"),
            attempts: delivery.attempts,
            last_error: some(&delivery.last_error),
            create_time: time(delivery.create_time),
            last_attempt_time: time(delivery.last_attempt_time),
            next_attempt_time: time(delivery.next_attempt_time),
            end_time: time(delivery.end_time),
        }
    }
}

impl DeliveryReport {
    /// For people.
    pub fn line(&self) -> String {
        let mut line = format!(
            "{}  {}  {}  {}  {} attempts",
            printable(&self.name),
            printable(&self.state),
            printable(&self.r#type),
            printable(&self.job),
            self.attempts
        );
        if let Some(next) = &self.next_attempt_time {
            line += &format!("  next {next}");
        }
        if let Some(error) = &self.last_error {
            line += &format!("  {}", printable(error));
        }
        line
    }
}
