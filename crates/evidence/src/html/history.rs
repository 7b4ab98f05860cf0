//! What was before the claim: dates of suspect and asset, and what had been tried.
use super::text::{hash, sent};
use crate::history::History;
use crate::words::grouped;
use maud::{Markup, html};

/// Dates and counts, each in a row.
pub(super) fn section(history: &History) -> Markup {
    html! {
        section {
            h2 { "What was before" }
            @if history.registered_later() {
                p { strong { "The asset was registered after a file of the suspect was seen. That file can\u{2019}t carry its mark." } }
            }
            table.facts {
                caption { "Dates and earlier tries" }
                tbody {
                    tr { th scope="row" { "A file of the suspect first seen (UTC)" } td { time datetime=(history.first_seen) { (history.first_seen) } } }
                    @if let Some(asset) = &history.asset {
                        tr { th scope="row" { "Asset" } td { (sent(&asset.asset)) } }
                        tr { th scope="row" { "Asset registered (UTC)" } td { time datetime=(asset.time) { (asset.time) } } }
                        tr { th scope="row" { "Its commitment" } td { (sent(&asset.commitment)) ", number " (grouped(asset.sequence)) " of the chain" } }
                        tr { th scope="row" { "Hash of the commitment" } td { (hash(&asset.hash)) } }
                        @if let Some(time) = asset.revealed {
                            tr { th scope="row" { "Its word no secret since (UTC)" } td { time datetime=(time) { (time) } } }
                        }
                    }
                    @if let Some(assets) = history.assets_of_owner {
                        tr { th scope="row" { "Assets of this owner under the key" } td { (grouped(assets)) } }
                    }
                    tr { th scope="row" { "Readings with this key so far, of any suspect" } td { (grouped(history.readings_of_key)) } }
                }
            }
        }
    }
}
