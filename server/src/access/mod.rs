//! Who may call what: projects, scopes, tokens, and the one table of calls and what they need.
mod caller;
mod methods;
mod scope;
mod secret;

pub use caller::{Caller, DEFAULT_PROJECT, check_project};
pub use methods::{METHODS, Need, RESOLUTION, need, need_to_resolve};
pub use scope::{Scope, Scopes};
pub use secret::{Fresh, TOKEN_VARIABLE, fresh, hash};
