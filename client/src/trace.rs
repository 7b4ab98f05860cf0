//! What the calls of a command are a part of, as W3C Trace Context has it: what `TRACEPARENT` says; and below that, or by
//! itself, the command's own span, where `OTEL_EXPORTER_OTLP_ENDPOINT` names a collector. It is sent there by OTLP when
//! the command is over, and holds the command's name and how it ended, and nothing of what it was given.
use std::collections::HashMap;
use std::time::Duration;

use opentelemetry::propagation::TextMapPropagator as _;
use opentelemetry::trace::{
    Span as _, SpanContext, SpanKind, Status, TraceContextExt as _, Tracer as _, TracerProvider as _,
};
use opentelemetry::{Context, KeyValue};
use opentelemetry_otlp::SpanExporter;
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
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
        let given = variable("TRACEPARENT").as_deref().and_then(context);
        let own = match is_collected(variable) {
            true => Own::begin(command, given.clone()),
            false => None,
        };
        let part_of = own.as_ref().map(|own| own.span.span_context().clone()).or(given);
        Self {
            header: part_of.and_then(text).and_then(|text| text.parse().ok()),
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

/// The span that a `traceparent` names; none where it makes no sense.
fn context(text: &str) -> Option<SpanContext> {
    let header = HashMap::from([(HEADER.to_owned(), text.to_owned())]);
    let found = TraceContextPropagator::new().extract_with_context(&Context::new(), &header);
    Some(found.span().span_context().clone()).filter(SpanContext::is_valid)
}

/// A span as `traceparent` names it.
fn text(context: SpanContext) -> Option<String> {
    let mut header = HashMap::new();
    let context = Context::new().with_remote_span_context(context);
    TraceContextPropagator::new().inject_context(&context, &mut header);
    header.remove(HEADER)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIVEN: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

    #[test]
    fn parents_are_read_as_they_are_written() {
        assert_eq!(text(context(GIVEN).unwrap()).unwrap(), GIVEN);
        assert_eq!(text(context(&format!(" {GIVEN}\n")).unwrap()).unwrap(), GIVEN);
        let nobody = GIVEN.replace("b7ad6b7169203331", "0000000000000000");
        for nonsense in ["", "00", "é", &GIVEN.replace("00-", "ff-"), &nobody] {
            assert!(context(nonsense).is_none(), "{nonsense}");
        }
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
