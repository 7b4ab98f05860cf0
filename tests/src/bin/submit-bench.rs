//! Measures submission: how long `CreateJob` takes over the wire while the queue fills, and the server's memory then.
//!
//! `cargo run --release --bin submit-bench` (which needs `cargo build --release --workspace` before).
//! Arguments: how many jobs (1000), and how many callers at once (1). Exits with 1 when the 99th percentile is not
//! under 50 ms, or the server needs 256 MB or more.
use std::process::ExitCode;
use std::time::{Duration, Instant};

use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{CreateJobRequest, Job, KeySpec};
use guardsplat_tests::{Service, TestEnvironment};
use uuid::Uuid;

const P99: Duration = Duration::from_millis(50);
const MEMORY_KB: u64 = 256_000;

#[tokio::main]
async fn main() -> ExitCode {
    let mut arguments = std::env::args()
        .skip(1)
        .map(|text| text.parse().ok().filter(|&n: &usize| n > 0));
    let (Some(jobs), Some(callers)) = (
        arguments.next().unwrap_or(Some(1000)),
        arguments.next().unwrap_or(Some(1)),
    ) else {
        eprintln!("error: wants the number of jobs, and of callers at once");
        return ExitCode::FAILURE;
    };
    let mut service = Service::start(TestEnvironment::new(), "");
    let start = Instant::now();
    let mut tasks = Vec::new();
    for caller in 0..callers {
        let client = JobServiceClient::new(service.channel().await);
        tasks.push(tokio::spawn(submit(client, (caller..jobs).step_by(callers).count())));
    }
    let mut times = Vec::with_capacity(jobs);
    for task in tasks {
        times.extend(task.await.expect("a caller"));
    }
    let all = start.elapsed();
    times.sort_unstable();
    let share = |percent: usize| times[(times.len() * percent).div_ceil(100) - 1];
    let [p50, p99, most] = [share(50), share(99), share(100)];
    let [now, peak] = ["VmRSS:", "VmHWM:"].map(|field| memory(service.server().id(), field));
    println!("{jobs} jobs by {callers} at once in {all:.2?}: p50 {p50:.2?}, p99 {p99:.2?}, slowest {most:.2?}");
    println!("server: {} MB resident, {} MB at most", now / 1000, peak / 1000);
    ExitCode::from(u8::from(p99 >= P99 || peak >= MEMORY_KB))
}

/// Submits so many jobs, and tells how long each took to be acknowledged.
async fn submit(mut client: JobServiceClient<tonic::transport::Channel>, count: usize) -> Vec<Duration> {
    let mut times = Vec::with_capacity(count);
    for number in 0..count {
        let spec = KeySpec {
            bits: 32,
            seed: None,
            ..KeySpec::default()
        };
        let job = Job {
            display_name: format!("number {number}"),
            spec: Some(Spec::CreateKey(spec)),
            ..Job::default()
        };
        let request = CreateJobRequest {
            job: Some(job),
            request_id: Uuid::new_v4().to_string(),
        };
        let begin = Instant::now();
        client.create_job(request).await.expect("the job is taken");
        times.push(begin.elapsed());
    }
    times
}

/// A process's memory in kB, as the kernel says under `field`.
fn memory(process: u32, field: &str) -> u64 {
    let path = format!("/proc/{process}/status");
    let status = std::fs::read_to_string(path).expect("Linux tells of its processes");
    let value = status.lines().find_map(|line| line.strip_prefix(field));
    let number = value.and_then(|value| value.split_whitespace().next()?.parse().ok());
    number.expect("a number of kB")
}
