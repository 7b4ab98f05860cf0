//! Stores that are services: S3, GCS and Azure by object_store, with credentials from the environment, and with limits
//! on how long anything is tried.
use std::sync::Arc;
use std::time::Duration;

use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::path::Path;
use object_store::prefix::PrefixStore;
use object_store::signer::Signer;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};

use super::place::Service;

/// What names of variables begin with that say how a store is reached, and as whom.
const VARIABLES: [&str; 3] = ["AWS_", "GOOGLE_", "AZURE_"];
/// Others of them: where machines of Google and Azure find who they are.
const OTHER_VARIABLES: [&str; 3] = ["SERVICE_ACCOUNT", "IDENTITY_ENDPOINT", "IDENTITY_HEADER"];

/// How long a connection may take to be made.
const CONNECT: Duration = Duration::from_secs(3);
/// How long one try of a request may take, the bytes of a part included.
const TRY: Duration = Duration::from_secs(30);
/// The same for copies inside the store, which bring no byte before they are done.
const LONG_TRY: Duration = super::COPY;
/// How often a request is tried again, while this has not passed since the first time.
const TRIES: usize = 6;
const TRY_AGAIN_FOR: Duration = Duration::from_secs(8);

/// A container, seen from the prefix on.
pub(super) struct Remote {
    pub store: Arc<dyn ObjectStore>,
    /// The same, for requests that take long.
    pub patient: Arc<dyn ObjectStore>,
    pub signer: Arc<dyn Signer>,
}

/// Whether a variable of this name may hold what opens a store: not for other programs.
pub fn is_of_stores(name: &str) -> bool {
    VARIABLES.iter().any(|begin| name.starts_with(begin)) || OTHER_VARIABLES.contains(&name)
}

/// Opens a container. Nothing is sent yet.
pub(super) fn open(
    service: Service,
    name: &str,
    prefix: &Path,
    environment: impl IntoIterator<Item = (String, String)>,
) -> object_store::Result<Remote> {
    // reqwest takes the process's provider. Another one that was chosen before would do as well.
    let _ = rustls::crypto::ring::default_provider().install_default();
    let variables = environment.into_iter().filter(|(_, value)| !value.trim().is_empty());
    let variables: Vec<_> = variables.collect();
    let opened = |one_try| {
        let (client, variables) = (client(one_try), variables.iter().cloned());
        match service {
            Service::S3 => s3(name, client, variables).map(|store| behind(store, prefix)),
            Service::Google => google(name, client, variables).map(|store| behind(store, prefix)),
            Service::Azure => azure(name, client, variables).map(|store| behind(store, prefix)),
        }
    };
    let (store, signer) = opened(TRY)?;
    let (patient, _) = opened(LONG_TRY)?;
    Ok(Remote { store, patient, signer })
}

fn s3(
    bucket: &str,
    client: ClientOptions,
    variables: impl Iterator<Item = (String, String)>,
) -> object_store::Result<object_store::aws::AmazonS3> {
    let mut builder = AmazonS3Builder::new()
        .with_client_options(client)
        // Objects go one by one, in the way that every service of this kind knows.
        .with_disable_bulk_delete(true);
    for (variable, value) in variables.filter(|(variable, _)| variable.starts_with("AWS_")) {
        if let Ok(key) = variable.to_ascii_lowercase().parse() {
            builder = builder.with_config(key, value);
        }
    }
    builder.with_retry(retry()).with_bucket_name(bucket).build()
}

fn google(
    bucket: &str,
    client: ClientOptions,
    variables: impl Iterator<Item = (String, String)>,
) -> object_store::Result<object_store::gcp::GoogleCloudStorage> {
    let mut builder = GoogleCloudStorageBuilder::new().with_client_options(client);
    for (variable, value) in variables {
        if !variable.starts_with("GOOGLE_") && variable != "SERVICE_ACCOUNT" {
            continue;
        }
        if let Ok(key) = variable.to_ascii_lowercase().parse() {
            builder = builder.with_config(key, value);
        }
    }
    builder.with_retry(retry()).with_bucket_name(bucket).build()
}

fn azure(
    container: &str,
    client: ClientOptions,
    variables: impl Iterator<Item = (String, String)>,
) -> object_store::Result<object_store::azure::MicrosoftAzure> {
    let mut builder = MicrosoftAzureBuilder::new().with_client_options(client);
    for (variable, value) in variables {
        if variable == "IDENTITY_ENDPOINT" {
            builder = builder.with_msi_endpoint(value);
        } else if variable.starts_with("AZURE_")
            && let Ok(key) = variable.to_ascii_lowercase().parse()
        {
            builder = builder.with_config(key, value);
        }
    }
    builder.with_retry(retry()).with_container_name(container).build()
}

fn behind(store: impl ObjectStore + Signer + Clone, prefix: &Path) -> (Arc<dyn ObjectStore>, Arc<dyn Signer>) {
    let store = Arc::new(PrefixStore::new(store, prefix.clone()));
    (store.clone(), store)
}

fn client(one_try: Duration) -> ClientOptions {
    ClientOptions::new().with_connect_timeout(CONNECT).with_timeout(one_try)
}

fn retry() -> RetryConfig {
    RetryConfig {
        backoff: BackoffConfig {
            init_backoff: Duration::from_millis(100),
            max_backoff: Duration::from_secs(2),
            base: 2.0,
        },
        max_retries: TRIES,
        retry_timeout: TRY_AGAIN_FOR,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opened(service: Service, variables: &[(&str, &str)]) -> object_store::Result<Remote> {
        let variables = variables
            .iter()
            .map(|(name, value)| (name.to_string(), value.to_string()));
        open(service, "container", &Path::from("a/b"), variables)
    }

    #[tokio::test]
    async fn each_service_is_opened_by_its_own_variables() {
        let soon = Duration::from_secs(60);
        let path = Path::from("c");
        for (service, variables, begin) in [
            (
                Service::S3,
                vec![
                    ("AWS_ACCESS_KEY_ID", "id"),
                    ("AWS_SECRET_ACCESS_KEY", "5ec2e7"),
                    ("AWS_ENDPOINT", "http://127.0.0.1:1"),
                    ("AWS_ALLOW_HTTP", "true"),
                    ("AWS_REGION", ""),
                ],
                "http://127.0.0.1:1/container/a/b/c?",
            ),
            (
                Service::Azure,
                vec![
                    ("AZURE_STORAGE_ACCOUNT_NAME", "account"),
                    ("AZURE_STORAGE_ACCOUNT_KEY", "NWVjMmU3"),
                ],
                "https://account.blob.core.windows.net/container/a/b/c?",
            ),
        ] {
            let remote = opened(service, &variables).unwrap();
            let url = remote.signer.signed_url(object_store::signer::Method::GET, &path, soon);
            let url = url.await.unwrap().to_string();
            assert!(url.starts_with(begin), "{url}");
            assert!(!url.contains("5ec2e7"), "{url}");
        }
        assert!(opened(Service::Google, &[("GOOGLE_SERVICE_ACCOUNT_KEY", "{}")]).is_err());
        assert!(opened(Service::Google, &[("GOOGLE_SKIP_SIGNATURE", "true")]).is_ok());
    }

    #[test]
    fn credentials_are_known_by_their_names() {
        for name in [
            "AWS_SECRET_ACCESS_KEY",
            "GOOGLE_APPLICATION_CREDENTIALS",
            "AZURE_CLIENT_SECRET",
        ] {
            assert!(is_of_stores(name));
        }
        for name in ["PATH", "GUARDSPLAT_TOKEN", "VK_ICD_FILENAMES"] {
            assert!(!is_of_stores(name));
        }
    }
}
