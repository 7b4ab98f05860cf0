//! What the calls of a command are a part of, as W3C Trace Context has it: what `TRACEPARENT` says; and below that, or by
//! itself, the command's own span, where `OTEL_EXPORTER_OTLP_ENDPOINT` names a collector. It is sent there by OTLP when
//! the command is over, and holds the command's name and how it ended, and nothing of what it was given.
use std::time::Duration;

use opentelemetry::trace::{
    Span as _, SpanContext, SpanId, SpanKind, Status, TraceContextExt as _, TraceFlags, TraceId, TraceState,
    Tracer as _, TracerProvider as _,
};
use opentelemetry::{Context, KeyValue};
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::{SdkTracerProvider, Span};
use tonic::metadata::{Ascii, MetadataValue};

/// The header of a call.
pub const HEADER: &str = "traceparent";
/// What names a collector: for traces, or for all that OpenTelemetry has.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];
/// How the client is called in traces, unless `OTEL_SERVICE_NAME` says otherwise.
const SERVICE: &str = "guardsplat";
/// A collector is waited for so long in the end.
const LAST: Duration = Duration::from_secs(1);

/// What a command is a part of, until it is over.
#[derive(Default)]
pub struct Trace {
    /// What goes into the header of its calls; none where nobody traces.
    pub header: Option<MetadataValue<Ascii>>,
    own: Option<Own>,
}

/// The command's span, and what sends it.
struct Own {
    provider: SdkTracerProvider,
    span: Span,
}

impl Trace {
    /// Begins, as the environment says. Must be called where tokio runs.
    pub fn begin(command: &str) -> Self {
        let variable = |name: &str| std::env::var(name).ok();
        let given = variable("TRACEPARENT").filter(|text| is_parent(text.trim()));
        let own = match is_collected(variable) {
            true => Own::begin(command, given.as_deref().and_then(context)),
            false => None,
        };
        let text = match &own {
            Some(own) => Some(text(own.span.span_context())),
            None => given,
        };
        Self {
            header: text.and_then(|text| text.trim().parse().ok()),
            own,
        }
    }

    /// The command is over: sends its span. A collector that is away is no failure of the command's, and holds it up for
    /// a moment only.
    pub async fn end(self, exit: u8, failure: Option<String>) {
        let Some(Own { provider, mut span }) = self.own else {
            return;
        };
        span.set_attribute(KeyValue::new("process.exit.code", i64::from(exit)));
        if let Some(reason) = failure {
            span.set_attribute(KeyValue::new("error.type", reason));
            span.set_status(Status::error(""));
        }
        span.end();
        drop(span);
        // The exporter needs this thread meanwhile. What it says in the end is nothing that the command could help.
        let sent = tokio::task::spawn_blocking(move || provider.shutdown_with_timeout(LAST));
        let _ = tokio::time::timeout(2 * LAST, sent).await;
    }
}

impl Own {
    /// None where the environment's words on the exporter make no sense: the command has other things to do.
    fn begin(command: &str, parent: Option<SpanContext>) -> Option<Self> {
        let exporter = SpanExporter::builder().with_tonic().build().ok()?;
        let mut resource = Resource::builder();
        if std::env::var_os("OTEL_SERVICE_NAME").is_none() {
            resource = resource.with_service_name(SERVICE);
        }
        let provider = SdkTracerProvider::builder()
            .with_resource(resource.build())
            .with_batch_exporter(exporter)
            .build();
        let tracer = provider.tracer(env!("CARGO_PKG_NAME"));
        let above = match parent {
            Some(parent) => Context::new().with_remote_span_context(parent),
            None => Context::new(),
        };
        let builder = tracer
            .span_builder(format!("guardsplat {command}"))
            .with_kind(SpanKind::Client);
        let span = builder.start_with_context(&tracer, &above);
        Some(Self { provider, span })
    }
}

/// Whether traces are collected.
fn is_collected(variable: impl Fn(&str) -> Option<String>) -> bool {
    let off = variable("OTEL_SDK_DISABLED").is_some_and(|value| value.trim().eq_ignore_ascii_case("true"));
    let named = |name| variable(name).is_some_and(|endpoint| !endpoint.trim().is_empty());
    !off && ENDPOINTS.into_iter().any(named)
}

/// Whether a text has the form of version 00; what is in it the server looks at.
fn is_parent(text: &str) -> bool {
    let lengths: Vec<usize> = text.split('-').map(str::len).collect();
    let plain = text.bytes().all(|b| b == b'-' || b.is_ascii_hexdigit());
    text.starts_with("00-") && lengths == [2, 32, 16, 2] && plain
}

/// The span that a text of that form names; none where there can't be such a one.
fn context(text: &str) -> Option<SpanContext> {
    let [_, trace, span, flags] = text.trim().split('-').collect::<Vec<_>>()[..] else {
        return None;
    };
    let context = SpanContext::new(
        TraceId::from_hex(trace).ok()?,
        SpanId::from_hex(span).ok()?,
        TraceFlags::new(u8::from_str_radix(flags, 16).ok()?) & TraceFlags::SAMPLED,
        true,
        TraceState::default(),
    );
    context.is_valid().then_some(context)
}

/// A span as the header names it.
fn text(context: &SpanContext) -> String {
    let flags = u8::from(context.is_sampled());
    format!("00-{}-{}-{flags:02x}", context.trace_id(), context.span_id())
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIVEN: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

    #[test]
    fn parents_are_read_as_they_are_written() {
        assert!(is_parent(GIVEN));
        assert_eq!(text(&context(GIVEN).unwrap()), GIVEN);
        for nonsense in ["", "00-1-2-3", "é", &GIVEN.replace("00-", "ff-")] {
            assert!(!is_parent(nonsense), "{nonsense}");
        }
        let nobody = GIVEN.replace("b7ad6b7169203331", "0000000000000000");
        assert!(is_parent(&nobody) && context(&nobody).is_none());
    }

    #[test]
    fn traces_are_collected_where_the_environment_says_so() {
        let collected = |set: &[(&str, &str)]| {
            is_collected(|name| {
                let found = set.iter().find(|(known, _)| *known == name);
                found.map(|(_, value)| (*value).to_owned())
            })
        };
        assert!(!collected(&[]));
        assert!(!collected(&[(ENDPOINTS[1], " ")]));
        for endpoint in ENDPOINTS {
            assert!(collected(&[(endpoint, "http://collector:4317")]));
            assert!(!collected(&[
                (endpoint, "http://collector:4317"),
                ("OTEL_SDK_DISABLED", "TRUE")
            ]));
        }
    }
}
