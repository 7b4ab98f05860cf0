//! Traces: from the caller through a call, a job's attempts and their stages to its worker. What a caller says it is a
//! part of (W3C Trace Context, `traceparent`) is kept with the job and told to the worker in any case; spans are made,
//! and sent by OTLP, where `OTEL_EXPORTER_OTLP_ENDPOINT` names a collector.
//!
//! Spans hold names of calls, kinds and ids of jobs, and numbers; nothing that was sent, and no secret.
use std::collections::HashMap;
use std::time::{Duration, SystemTime};

use guardsplat_proto::v1::progress::Stage;
use opentelemetry::propagation::TextMapPropagator as _;
use opentelemetry::trace::{Span as _, SpanContext, SpanKind, TraceContextExt as _, Tracer as _, TracerProvider as _};
use opentelemetry::{Context, KeyValue};
use opentelemetry_otlp::{SpanExporter, WithExportConfig as _};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::{SdkTracer, SdkTracerProvider};

use crate::error::{Error, Result};
use crate::ledger::JobRow;
use crate::metrics;

/// A span under way; it ends when it is dropped.
pub type Span = opentelemetry_sdk::trace::Span;

/// The header of a call, as the propagator of OpenTelemetry names it.
const HEADER: &str = "traceparent";
/// What names a collector: for traces, or for all that OpenTelemetry has.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];
/// How the service is called in traces, unless `OTEL_SERVICE_NAME` says otherwise.
const SERVICE: &str = "guardsplat-server";
/// Calls that begin no trace: workers', which come every second, and those of whoever looks after the server.
const QUIET: [&str; 2] = ["guardsplat.v1.WorkerService/", "grpc."];
/// What is left to send gets so long at the end.
const LAST: Duration = Duration::from_secs(2);

/// Makes spans, if anybody wants them.
#[derive(Clone, Debug, Default)]
pub struct Traces(Option<Exporting>);

#[derive(Clone, Debug)]
struct Exporting {
    provider: SdkTracerProvider,
    tracer: SdkTracer,
}

impl Traces {
    /// To the collector that the environment names; nowhere where it names none. The other variables of OpenTelemetry's
    /// exporter count too. Must be called where tokio runs.
    pub fn from_environment() -> Result<Self> {
        let named = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let off = std::env::var("OTEL_SDK_DISABLED").is_ok_and(|value| value.eq_ignore_ascii_case("true"));
        if off || !ENDPOINTS.into_iter().any(named) {
            return Ok(Self::default());
        }
        Self::open(None)
    }

    /// To the collector at an address; or to the one that the environment names.
    pub fn open(endpoint: Option<&str>) -> Result<Self> {
        let mut builder = SpanExporter::builder().with_tonic();
        if let Some(endpoint) = endpoint {
            builder = builder.with_endpoint(endpoint);
        }
        let exporter = builder.build().map_err(|error| {
            Error::Startup(format!(
                "the exporter of traces, by OTEL_EXPORTER_OTLP_ENDPOINT: {error}"
            ))
        })?;
        let mut resource = Resource::builder();
        if std::env::var_os("OTEL_SERVICE_NAME").is_none() {
            resource = resource.with_service_name(SERVICE);
        }
        let provider = SdkTracerProvider::builder()
            .with_resource(resource.build())
            .with_batch_exporter(exporter)
            .build();
        let tracer = provider.tracer(env!("CARGO_PKG_NAME"));
        Ok(Self(Some(Exporting { provider, tracer })))
    }

    /// The span of a call to be answered, below what the caller says it is a part of.
    pub fn call(&self, method: &'static str, parent: Option<&SpanContext>) -> Option<Span> {
        let Exporting { tracer, .. } = self.0.as_ref()?;
        if parent.is_none() && QUIET.into_iter().any(|quiet| method.starts_with(quiet)) {
            return None;
        }
        let (service, name) = method.split_once('/').unwrap_or((method, method));
        let builder = tracer
            .span_builder(method)
            .with_kind(SpanKind::Server)
            .with_attributes([
                KeyValue::new("rpc.system", "grpc"),
                KeyValue::new("rpc.service", service),
                KeyValue::new("rpc.method", name),
            ]);
        Some(builder.start_with_context(tracer, &below(parent)))
    }

    /// The span of an attempt that begins, below the request that made its job; and one for the time that the job
    /// waited. Of jobs that nobody traces there are none.
    pub fn attempt(&self, job: &JobRow) -> Option<Span> {
        let Exporting { tracer, .. } = self.0.as_ref()?;
        let request = parse(job.trace_parent.as_deref()?)?;
        let context = below(Some(&request));
        let attributes = [
            KeyValue::new("guardsplat.job", job.id.to_string()),
            KeyValue::new("guardsplat.kind", metrics::kind(job.kind())),
            KeyValue::new("guardsplat.attempt", i64::from(job.attempt)),
        ];
        if metrics::is_first(job) {
            let waited = tracer
                .span_builder("wait in queue")
                .with_start_time(time(job.create_time))
                .with_attributes(attributes.clone());
            waited.start_with_context(tracer, &context);
        }
        let name = match metrics::kind(job.kind()) {
            "embed" => "embed",
            "verify" => "verify",
            _ => "create key",
        };
        let builder = tracer.span_builder(name).with_attributes(attributes);
        Some(builder.start_with_context(tracer, &context))
    }

    /// The span of a stage that is over.
    pub fn stage(&self, stage: Stage, attempt: &SpanContext, began: SystemTime) {
        let Some(Exporting { tracer, .. }) = &self.0 else {
            return;
        };
        let builder = tracer.span_builder(metrics::stage(stage)).with_start_time(began);
        // Dropped at once, it ends now.
        builder.start_with_context(tracer, &below(Some(attempt)));
    }

    /// Sends what is left.
    pub async fn close(&self) {
        let Some(Exporting { provider, .. }) = self.0.clone() else {
            return;
        };
        let closed = tokio::task::spawn_blocking(move || provider.shutdown_with_timeout(LAST));
        if let Ok(Err(error)) = closed.await {
            tracing::warn!(%error, "the last traces could not be sent");
        }
    }
}

/// The context of whatever is below this span.
fn below(parent: Option<&SpanContext>) -> Context {
    match parent {
        Some(parent) => Context::new().with_remote_span_context(parent.clone()),
        None => Context::new(),
    }
}

/// What a `traceparent` says; none where it makes no sense.
pub fn parse(text: &str) -> Option<SpanContext> {
    let header = HashMap::from([(HEADER.to_owned(), text.to_owned())]);
    let found = TraceContextPropagator::new().extract_with_context(&Context::new(), &header);
    Some(found.span().span_context().clone()).filter(SpanContext::is_valid)
}

/// A span as `traceparent` names it; empty for one that is none.
pub fn text(context: &SpanContext) -> String {
    let mut header = HashMap::new();
    TraceContextPropagator::new().inject_context(&below(Some(context)), &mut header);
    header.remove(HEADER).unwrap_or_default()
}

/// What to say about a span in the end.
pub fn note(span: &mut Option<Span>, name: &'static str, value: &'static str, failed: bool) {
    let Some(span) = span else { return };
    span.set_attribute(KeyValue::new(name, value));
    if failed {
        span.set_status(opentelemetry::trace::Status::error(value));
    }
}

/// What a span is called by those below it.
pub fn context(span: &Span) -> &SpanContext {
    span.span_context()
}

fn time(micros: i64) -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_micros(u64::try_from(micros).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

    #[test]
    fn trace_parents_are_read_as_they_are_written() {
        assert_eq!(text(&parse(GOOD).unwrap()), GOOD);
        let unsampled = GOOD.replace("-01", "-00");
        assert_eq!(text(&parse(&unsampled).unwrap()), unsampled);
        // Flags that are not known are not passed on.
        assert_eq!(text(&parse(&GOOD.replace("-01", "-ff")).unwrap()), GOOD);
        // What is written is of version 00, whatever was read.
        assert_eq!(text(&parse(&GOOD.replace("00-", "01-")).unwrap()), GOOD);
        assert_eq!(text(&SpanContext::NONE), "");
        for bad in [
            "",
            "00",
            "00-00000000000000000000000000000000-b7ad6b7169203331-01",
            "00-0af7651916cd43dd8448eb211c80319c-0000000000000000-01",
            "ff-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01",
            "00-0AF7651916CD43DD8448EB211C80319C-b7ad6b7169203331-01",
            "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01-extra",
            "00-éaf7651916cd43dd8448eb211c80319-b7ad6b7169203331-01",
        ] {
            assert!(parse(bad).is_none(), "{bad}");
        }
    }
}
