//! That figures are what happened, and that their number is bounded.
use guardsplat_proto::v1::EmbedResult;

use super::*;
use guardsplat_proto::v1::EmbedSpec;

use crate::ledger::{
    Failure, FailureReason, JobKind, JobRow, JobSpec, JobState, ResourceRequirements, Running, Waiting,
};

fn job(state: JobState, attempt: i32) -> JobRow {
    JobRow {
        id: uuid::Uuid::now_v7(),
        project: "default".into(),
        display_name: String::new(),
        spec: JobSpec::Embed(EmbedSpec::default()),
        state,
        cancel_requested: false,
        attempt,
        max_attempts: 3,
        progress: None,
        result: None,
        failure: None,
        create_time: 1_000_000,
        update_time: 0,
        start_time: Some(3_500_000),
        end_time: state.is_over().then_some(9_500_000),
        run_after: None,
        revision: 2,
        trace_parent: None,
        priority: 0,
        requirements: ResourceRequirements::default(),
        queue_position: None,
    }
}

fn has(metrics: &Metrics, lines: &[&str]) {
    let text = metrics.text().unwrap();
    for line in lines {
        assert!(text.lines().any(|there| there == *line), "{line} is not in\n{text}");
    }
}

#[test]
fn attempts_end_in_each_of_their_ways() {
    let metrics = Metrics::default();
    metrics.given(&job(JobState::Running, 1));
    metrics.given(&JobRow {
        revision: 4,
        ..job(JobState::Running, 2)
    });
    let failed = |state, reason| JobRow {
        failure: Some(Failure {
            reason,
            message: String::new(),
        }),
        ..job(state, 1)
    };
    let lost = failed(JobState::Queued, FailureReason::WorkerLost);
    assert!(was_lost(&lost) && !was_lost(&failed(JobState::Failed, FailureReason::Internal)));
    metrics.attempt_ended(&lost, true);
    metrics.attempt_ended(&failed(JobState::Queued, FailureReason::Internal), false);
    metrics.attempt_ended(&failed(JobState::Failed, FailureReason::AttemptsExhausted), false);
    metrics.attempt_ended(&job(JobState::Queued, 0), false);
    metrics.attempt_ended(&job(JobState::Succeeded, 1), false);
    has(
        &metrics,
        &[
            r#"guardsplat_job_attempts_total{kind="embed"} 2"#,
            r#"guardsplat_job_attempts_ended_total{kind="embed",outcome="lost"} 1"#,
            r#"guardsplat_job_attempts_ended_total{kind="embed",outcome="failed"} 2"#,
            r#"guardsplat_job_attempts_ended_total{kind="embed",outcome="released"} 1"#,
            r#"guardsplat_job_attempts_ended_total{kind="embed",outcome="succeeded"} 1"#,
            r#"guardsplat_job_attempts_ended_total{kind="verify",outcome="lost"} 0"#,
            r#"guardsplat_job_retries_total{kind="embed"} 2"#,
            r#"guardsplat_jobs_ended_total{kind="embed",state="failed"} 1"#,
            r#"guardsplat_jobs_ended_total{kind="embed",state="succeeded"} 1"#,
            // The second attempt waited for other reasons.
            r#"guardsplat_job_wait_seconds_sum{kind="embed"} 2.5"#,
            r#"guardsplat_job_wait_seconds_count{kind="embed"} 1"#,
            r#"guardsplat_job_run_seconds_sum{kind="embed",state="failed"} 6.0"#,
        ],
    );
}

#[test]
fn the_queue_is_as_the_ledger_has_it_or_not_told() {
    let metrics = Metrics::default();
    let tally = Tally {
        queued: vec![Waiting {
            kind: JobKind::Verify,
            count: 7,
            since: 1_000_000,
        }],
        running: vec![Running {
            kind: JobKind::Embed,
            count: 2,
            memory: 3_000_000,
        }],
        failed: vec![
            (JobKind::Embed, FailureReason::AttemptsExhausted, 3),
            (JobKind::Embed, FailureReason::Unspecified, 1),
        ],
    };
    metrics.tally(Some(tally), 2_500_000);
    has(
        &metrics,
        &[
            r#"guardsplat_queued_jobs{kind="verify"} 7"#,
            r#"guardsplat_queued_jobs{kind="embed"} 0"#,
            r#"guardsplat_oldest_queued_job_age_seconds{kind="verify"} 1.5"#,
            r#"guardsplat_oldest_queued_job_age_seconds{kind="embed"} 0.0"#,
            r#"guardsplat_running_jobs{kind="embed"} 2"#,
            r#"guardsplat_running_memory_bytes{kind="embed"} 3000000"#,
            r#"guardsplat_running_memory_bytes{kind="verify"} 0"#,
            r#"guardsplat_dead_letters{kind="embed",reason="attempts_exhausted"} 3"#,
            r#"guardsplat_dead_letters{kind="embed",reason="unspecified"} 1"#,
            r#"guardsplat_dead_letters{kind="verify",reason="invalid_input"} 0"#,
        ],
    );
    metrics.tally(None, 0);
    let text = metrics.text().unwrap();
    assert!(!text.contains("guardsplat_queued_jobs{"), "{text}");
}

#[test]
fn memory_is_told_by_what_workers_compute_on() {
    let metrics = Metrics::default();
    let worker = |device: &str, memory| SeenWorker {
        version: String::new(),
        name: device.into(),
        device: device.into(),
        memory,
        clips: Vec::new(),
    };
    metrics.workers(Some(&[
        worker("cpu", Some(5)),
        worker("cpu", Some(7)),
        worker("wgpu: Some Card (1.2)", Some(i64::MAX)),
        worker("wgpu: Some Card (1.2)", Some(1)),
        worker("", None),
        worker("cpu of my own", Some(9)),
    ]));
    metrics.memory_taken(JobKind::Embed, Some(3 << 30), None);
    metrics.memory_taken(JobKind::Embed, None, Some(1 << 30));
    has(
        &metrics,
        &[
            r#"guardsplat_workers{device="cpu"} 2"#,
            r#"guardsplat_workers{device="wgpu"} 2"#,
            r#"guardsplat_workers{device="other"} 2"#,
            r#"guardsplat_worker_memory_bytes{device="cpu"} 12"#,
            &format!(r#"guardsplat_worker_memory_bytes{{device="wgpu"}} {}"#, i64::MAX),
            r#"guardsplat_worker_memory_bytes{device="other"} 9"#,
            r#"guardsplat_job_memory_bytes_bucket{le="2147483648.0",kind="embed"} 0"#,
            r#"guardsplat_job_memory_bytes_bucket{le="4294967296.0",kind="embed"} 1"#,
            r#"guardsplat_job_memory_bytes_count{kind="embed"} 1"#,
            r#"guardsplat_job_memory_bytes_count{kind="verify"} 0"#,
            r#"guardsplat_job_device_memory_bytes_sum{kind="embed"} 1073741824.0"#,
            r#"guardsplat_job_device_memory_bytes_count{kind="embed"} 1"#,
            r#"guardsplat_job_device_memory_bytes_count{kind="verify"} 0"#,
        ],
    );
    metrics.workers(None);
    let text = metrics.text().unwrap();
    assert!(!text.contains("guardsplat_workers{"), "{text}");
}

#[test]
fn marks_are_counted_by_what_is_read_from_them() {
    let metrics = Metrics::default();
    let mark = EmbedResult {
        bit_accuracy: 0.985,
        message_recovered: true,
        psnr_db: Some(36.5),
        ..EmbedResult::default()
    };
    metrics.marked(&mark);
    metrics.marked(&EmbedResult {
        bit_accuracy: f64::NAN,
        message_recovered: false,
        psnr_db: None,
        ..mark
    });
    has(
        &metrics,
        &[
            r#"guardsplat_marks_total{recovered="true"} 1"#,
            r#"guardsplat_marks_total{recovered="false"} 1"#,
            r#"guardsplat_mark_bit_accuracy_bucket{le="0.98"} 0"#,
            r#"guardsplat_mark_bit_accuracy_bucket{le="0.99"} 1"#,
            "guardsplat_mark_bit_accuracy_count 1",
            "guardsplat_mark_psnr_db_sum 36.5",
        ],
    );
}

/// Whatever is sent, there are only so many series.
#[test]
fn what_strangers_send_makes_no_series() {
    let metrics = Metrics::default();
    let series = || metrics.text().unwrap().lines().count();
    let before = series();
    for i in 0..1000 {
        let name = method(&format!("/guardsplat.v1.JobService/Call{i}"));
        metrics.call(name, Code::Unimplemented);
        metrics.refused(&format!("REASON_{i}"));
    }
    assert_eq!(series(), before + 1);
    has(
        &metrics,
        &[r#"guardsplat_calls_total{method="other",code="UNIMPLEMENTED"} 1000"#],
    );
    assert!(before < 2000, "{before} series");
}
