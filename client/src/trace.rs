//! What the calls of a command are a part of, as W3C Trace Context has it: what `TRACEPARENT` says, or a trace of the
//! command's own where `OTEL_EXPORTER_OTLP_ENDPOINT` says that traces are collected. Spans are the server's to send.
use tonic::metadata::{Ascii, MetadataValue};
use uuid::Uuid;

/// The header of a call.
pub const HEADER: &str = "traceparent";

/// What goes into the header; none where nobody traces.
pub fn parent() -> Option<MetadataValue<Ascii>> {
    let variable = |name| std::env::var(name).ok();
    find(variable("TRACEPARENT"), variable("OTEL_EXPORTER_OTLP_ENDPOINT"))
}

fn find(given: Option<String>, collector: Option<String>) -> Option<MetadataValue<Ascii>> {
    let given = given.filter(|text| is_parent(text.trim()));
    let collected = collector.is_some_and(|endpoint| !endpoint.trim().is_empty());
    let text = given.or_else(|| collected.then(fresh))?;
    text.trim().parse().ok()
}

fn fresh() -> String {
    let span = Uuid::new_v4().simple().to_string();
    format!("00-{}-{}-01", Uuid::new_v4().simple(), &span[..16])
}

/// Whether a text has the form of version 00; what is in it the server looks at.
fn is_parent(text: &str) -> bool {
    let lengths: Vec<usize> = text.split('-').map(str::len).collect();
    let plain = text.bytes().all(|b| b == b'-' || b.is_ascii_hexdigit());
    text.starts_with("00-") && lengths == [2, 32, 16, 2] && plain
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIVEN: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

    #[test]
    fn a_trace_is_passed_on_or_begun_where_it_is_collected() {
        let find = |given: &str, collector: &str| {
            let found = super::find(Some(given.into()), Some(collector.into()));
            found.map(|header| header.to_str().unwrap().to_owned())
        };
        assert_eq!(find(GIVEN, "").as_deref(), Some(GIVEN));
        assert_eq!(find(GIVEN, "http://collector:4317").as_deref(), Some(GIVEN));
        for nonsense in ["", "00-1-2-3", "é", &GIVEN.replace("00-", "ff-")] {
            assert_eq!(find(nonsense, ""), None);
            let begun = find(nonsense, "http://collector:4317").unwrap();
            assert!(is_parent(&begun), "{begun}");
        }
        assert_ne!(fresh(), fresh());
        assert!(super::find(None, None).is_none());
    }
}
