//! What is the same in both databases, written once: rows, and the statements that make, find and change them.
//!
//! The files beside this one are loaded twice, by [`sqlite`](super::sqlite) and by [`postgres`](super::postgres), as a
//! part of each (`#[path]`). What they take from the module that loads them:
//! - the types `DbConnection`, `DbRow` and `DbLedger`, and `DbLedger::read` and `DbLedger::change`, which carry out work
//!   on a connection;
//! - the macros of its dialect: `for_update!`, `for_share!`, `for_key_share!` and `skip_locked!` end a selection that
//!   locks rows, and are empty in SQLite, where there is one writer; `indexed_by!` names an index to a planner that
//!   would choose another; `greatest!` is the larger of two values, `total!` a sum; `in_order_join!` is a join that reads its left side
//!   in order;
//! - `SNAPSHOT`, which begins a transaction that sees one moment; `storable`, which makes a text one that the database
//!   can keep;
//! - the modules `queue`, `inputs`, `deliveries`, `presence` and `retention`, which each database has of its own.
//!
//! Statements number their values `$1`, `$2`, which both databases understand.

/// What a call does with a connection, with values of its own each time that it is tried.
macro_rules! with {
    ([$($value:ident),*] $db:ident => $call:expr) => {
        move |$db| {
            $(let $value = $value.clone();)*
            Box::pin(async move { $call.await })
        }
    };
}
