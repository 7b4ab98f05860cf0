//! A server that asks for tokens, and the tokens that are made on its machine.
use guardsplat_proto::v1::ListJobsRequest;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use tonic::{Code, Request, Status};
use tonic_health::pb::health_client::HealthClient;

use super::asks;
use super::support::postgres::Cluster;
use super::support::{Bench, Server, until};

async fn list(server: &Server, token: Option<&str>) -> Result<(), Status> {
    let mut request = Request::new(ListJobsRequest::default());
    if let Some(token) = token {
        let header = format!("Bearer {token}").parse().unwrap();
        request.metadata_mut().insert("authorization", header);
    }
    let mut jobs = JobServiceClient::new(server.channel().await);
    jobs.list_jobs(request).await.map(|_| ())
}

#[tokio::test]
async fn the_way_in_is_on_the_server_s_machine() {
    lets_in(Bench::new()).await;
}

#[tokio::test]
async fn the_way_in_leads_to_the_database_where_there_is_one() {
    let Some(cluster) = Cluster::start() else { return };
    cluster.create("ledger", None);
    let mut bench = Bench::new();
    bench.variable("GUARDSPLAT_DATABASE", &cluster.url("ledger"));
    let data = bench.data();
    let bench = lets_in(bench).await;
    assert!(!data.join("ledger.sqlite").exists());
    // Where it can't be reached, that is told without its password.
    cluster.remove("ledger");
    let url = format!("{}&password=5ec2e7", cluster.url("ledger"));
    let (status, out, err) = bench.says(&["--database", &url, "token", "list"]).await;
    assert!(!status.success() && out.is_empty());
    assert!(err.contains("does not exist") && !err.contains("5ec2e7"), "{err}");
}

/// The first token is made before there is a server, others beside it, and none is written down anywhere.
async fn lets_in(mut bench: Bench) -> Bench {
    bench.variable("GUARDSPLAT_ACCESS", "tokens");
    bench.variable("GUARDSPLAT_LOG_FILTER", "trace");
    let create = ["token", "create", "--scope", "embed", "--scope", "verify"];
    let (status, out, err) = bench.says(&[&create[..], &["--expires", "90d"]].concat()).await;
    assert_eq!(status.code(), Some(0), "{err}");
    let first = out.trim().to_owned();
    assert!(first.starts_with("gst_") && first.lines().count() == 1, "{out}");
    assert!(err.contains("embed, verify") && err.contains("  ends 2"), "{err}");
    assert!(!err.contains(&first));

    let server = bench.start().await;
    let health = HealthClient::new(server.channel().await).check(asks("")).await;
    health.expect("health is open to all");
    assert_eq!(list(&server, None).await.unwrap_err().code(), Code::Unauthenticated);
    list(&server, Some(&first)).await.unwrap();

    let (_, second, _) = bench.says(&[&create[..], &["--project", "studio"]].concat()).await;
    list(&server, Some(second.trim())).await.unwrap();
    let (_, listed, _) = bench.says(&["token", "list"]).await;
    assert_eq!(listed.lines().count(), 2, "{listed}");
    assert!(listed.lines().next().unwrap().contains("  studio  "), "{listed}");
    let (_, own, _) = bench.says(&["token", "list", "--project", "studio"]).await;
    let name = own.split("  ").next().unwrap();
    let (status, ..) = bench.says(&["token", "revoke", name]).await;
    assert_eq!(status.code(), Some(0));
    let refused = list(&server, Some(second.trim())).await.unwrap_err();
    assert_eq!(refused.message(), "the token is revoked");
    list(&server, Some(&first)).await.unwrap();
    server.stop().await;

    let log = bench.server_log();
    assert!(log.contains("opened") && log.lines().count() > 20, "{log}");
    for secret in [&first, second.trim()] {
        let digits = secret.rsplit('_').next().unwrap();
        assert!(!log.contains(digits) && !listed.contains(digits));
        for file in bench.kept() {
            let bytes = std::fs::read(&file).unwrap();
            assert!(
                !bytes.windows(64).any(|window| window == digits.as_bytes()),
                "{}",
                file.display()
            );
        }
    }
    bench
}

#[tokio::test]
async fn what_can_not_be_made_is_told() {
    let bench = Bench::new();
    for (arguments, told) in [
        (&["token", "create"][..], "--scope"),
        (
            &["token", "create", "--scope", "root"],
            "possible values: embed, verify, admin, worker",
        ),
        (
            &["token", "create", "--scope", "embed", "--project", "No Good"],
            "--project: must be 1 to 63",
        ),
        (
            &["token", "create", "--scope", "embed", "--expires", "soon"],
            "--expires",
        ),
        (
            &["token", "revoke", "0190a5d0-0000-7000-8000-00000000000a"],
            "tokens/0190a5d0-0000-7000-8000-00000000000a does not exist",
        ),
        (&["token", "revoke", "7"], "TOKEN: must be the id"),
    ] {
        let (status, out, err) = bench.says(arguments).await;
        assert!(!status.success() && out.is_empty(), "{arguments:?}");
        assert!(err.contains(told), "{arguments:?}: {err}");
    }
}

/// The embedded worker gets a token of its own, which ends with the server.
#[tokio::test]
async fn the_server_s_own_worker_is_let_in() {
    let mut bench = Bench::new();
    bench.variable("GUARDSPLAT_ACCESS", "tokens");
    bench.variable("GUARDSPLAT_TOKEN", "gst_of_another_server");
    bench.variable("GUARDSPLAT_CA", "/ca/of/another.pem");
    let server = bench
        .start_with_worker("echo \"$GUARDSPLAT_TOKEN$GUARDSPLAT_CA\" > $LOG; echo \"$@\" >> $LOG; exec sleep 60")
        .await;
    let log = until(|| bench.log(), |log| log.lines().count() == 2).await;
    let (token, arguments) = log.split_once('\n').unwrap();
    assert!(
        token.starts_with("gst_") && token.len() > 90 && !arguments.contains("gst_"),
        "{log}"
    );
    let refused = list(&server, Some(token)).await.unwrap_err();
    assert_eq!(
        refused.code(),
        Code::PermissionDenied,
        "it is good for a worker's calls only"
    );
    let worker = guardsplat_proto::v1::worker_service_client::WorkerServiceClient::new(server.channel().await);
    let mut request = Request::new(guardsplat_proto::v1::LeaseJobRequest {
        worker: "w".into(),
        wait: None,
        ..guardsplat_proto::v1::LeaseJobRequest::default()
    });
    let header = format!("Bearer {token}").parse().unwrap();
    request.metadata_mut().insert("authorization", header);
    assert_eq!(worker.clone().lease_job(request).await.unwrap().into_inner().job, None);
    server.stop().await;
    let (_, listed, _) = bench.says(&["token", "list"]).await;
    assert_eq!(listed, "");
}
