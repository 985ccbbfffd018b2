//! The client of a URL, with credentials from the environment.

use crate::lease::LeaseTimes;
use crate::objects::Objects;
use crate::profile::Profile;
use crate::requests::wait;
use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey, resolve_bucket_region};
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::{ClientOptions, ObjectStore, RetryConfig};
use parking_lot::Mutex;
use std::collections::BTreeMap;
use std::env;
use std::path::Path;
use std::sync::{Arc, Once};
use std::time::Duration;
use syntable_model::error::{Error, Result};
use syntable_model::files::DatasetPath;
use syntable_model::store::StoreFolder;

/// Time for a request with its answer. A part of a large file needs 16 MiB in it.
const REQUEST: Duration = Duration::from_secs(120);
/// Time to reach a server.
const CONNECT: Duration = Duration::from_secs(10);
/// Variables that name servers.
const ENDPOINTS: [&str; 5] =
    ["AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL", "AWS_ENDPOINT", "AZURE_STORAGE_ENDPOINT", "GOOGLE_BASE_URL"];
/// First letters of the variables that the clients read.
const PREFIXES: [&str; 3] = ["AWS_", "AZURE_", "GOOGLE_"];

/// A bucket, and the variables with which its client was made.
type Made = (String, BTreeMap<String, String>);

/// Buckets that were opened. A client keeps connections and tokens, so folders of one bucket share it.
static BUCKETS: Mutex<BTreeMap<Made, Arc<Objects>>> = Mutex::new(BTreeMap::new());

/// Opens the folder that a URL names.
pub fn open(url: &str) -> Result<StoreFolder> {
    let (scheme, rest) = url.split_once("://").unwrap_or_default();
    let (bucket, folder) = rest.split_once('/').unwrap_or((rest, ""));
    let is_name = |c: char| c.is_ascii_alphanumeric() || "-._$".contains(c);
    if bucket.is_empty() || !bucket.chars().all(is_name) {
        // The name may hold a password.
        return Err(Error::new(format!("the URL of the scheme `{scheme}` has no valid name of a bucket"))
            .help(format!("write `{scheme}://bucket/folder`; credentials come from variables of the environment")));
    }
    let name = format!("{scheme}://{bucket}");
    // As in paths: a joined folder may end with a slash.
    let folder: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    let folder = Some(folder.join("/")).filter(|folder| !folder.is_empty());
    let folder = folder.map(DatasetPath::new).transpose();
    let folder = folder.map_err(|error| Error::new(format!("`{url}`: {error}")))?;
    let whole = StoreFolder::new(objects(scheme, bucket, name)?);
    Ok(folder.map_or_else(|| whole.clone(), |folder| whole.inner(&folder)))
}

fn objects(scheme: &str, bucket: &str, name: String) -> Result<Arc<Objects>> {
    let made: Made = (name.clone(), variables(&PREFIXES).collect());
    made.1.iter().try_for_each(|(variable, value)| check_variable(variable, value))?;
    if let Some(objects) = BUCKETS.lock().get(&made) {
        return Ok(Arc::clone(objects));
    }
    static CRYPTOGRAPHY: Once = Once::new();
    // Another library of the process may have chosen one.
    CRYPTOGRAPHY.call_once(|| drop(rustls::crypto::ring::default_provider().install_default()));
    let (scheme, bucket) = (scheme.to_owned(), bucket.to_owned());
    let connect = move || match scheme.as_str() {
        "s3" => s3(&bucket),
        "gs" => gs(&bucket),
        _ => az(&bucket),
    };
    let objects = Arc::new(Objects::connected(Box::new(connect), name, LeaseTimes::default())?);
    BUCKETS.lock().insert(made, Arc::clone(&objects));
    Ok(objects)
}

/// The variables that begin with one of some texts. The program may have other variables that are no Unicode.
fn variables(prefixes: &[&str]) -> impl Iterator<Item = (String, String)> {
    let texts = env::vars_os().filter_map(|(key, value)| Some((key.into_string().ok()?, value.into_string().ok()?)));
    texts.filter(|(key, _)| prefixes.iter().any(|prefix| key.starts_with(prefix)))
}

/// Refuses values that the clients cannot put into requests.
fn check_variable(variable: &str, value: &str) -> Result<()> {
    if value.chars().any(char::is_control) {
        // The value may be a secret.
        return Err(Error::new(format!(
            "the environment variable {variable} has an end of line or another control character"
        ))
        .help("set it without; files of secrets often end with an end of line")
        .of_request());
    }
    let is_endpoint = ENDPOINTS.contains(&variable) && !(value.is_empty() && variable.starts_with("AWS_"));
    if is_endpoint && !is_server(value) {
        return Err(Error::new(format!("the environment variable {variable} is `{}`", without_password(value)))
            .help("write the address of a server, such as http://127.0.0.1:9000, or unset it")
            .of_request());
    }
    Ok(())
}

/// Whether a text is the address of a server, such as `https://host:9000/path`.
fn is_server(text: &str) -> bool {
    let Some(rest) = text.strip_prefix("http://").or_else(|| text.strip_prefix("https://")) else { return false };
    let address = rest.split(['/', '?', '#']).next().unwrap_or_default();
    let host = address.rsplit_once('@').map_or(address, |(_, host)| host);
    let (host, port) = match host.rsplit_once(':') {
        Some((host, port)) if !port.ends_with(']') => (host, Some(port)),
        _ => (host, None),
    };
    let is_host = !host.is_empty() && rest.chars().all(|c| c.is_ascii_graphic());
    is_host && port.is_none_or(|port| port.parse::<u16>().is_ok())
}

/// An address without the user and the password.
fn without_password(address: &str) -> &str {
    address.rsplit_once('@').map_or(address, |(_, host)| host)
}

/// Options of clients. An endpoint without encryption is used only if a variable names it.
fn options(endpoints: &[&str]) -> ClientOptions {
    let is_plain = endpoints.iter().filter_map(|name| env::var(name).ok()).any(|url| url.starts_with("http://"));
    ClientOptions::new().with_timeout(REQUEST).with_connect_timeout(CONNECT).with_allow_http(is_plain)
}

/// The error of variables that a client refuses.
fn invalid(url: &str, error: &object_store::Error, variables: &str) -> Error {
    let text = error.to_string();
    // The library names the store first, which the URL names.
    let text = text.split_once("error: ").map_or(&*text, |(_, text)| text);
    Error::new(text.split("source:").next().unwrap_or_default().trim_end())
        .in_file(url)
        .help(format!("check {variables}; the chapter on object stores has all variables"))
        .of_request()
}

/// The error of a store without credentials.
fn no_credentials(what: &str, ways: &str) -> Error {
    Error::new(format!("no credentials for {what} were found")).help(ways)
}

fn s3(bucket: &str) -> Result<Arc<dyn ObjectStore>> {
    let options = options(&ENDPOINTS[..3]);
    let mut builder = AmazonS3Builder::new().with_bucket_name(bucket);
    // An empty variable is like none.
    for (variable, value) in variables(&PREFIXES[..1]).filter(|(_, value)| !value.is_empty()) {
        if let Ok(key) = variable.to_ascii_lowercase().parse() {
            builder = builder.with_config(key, value);
        }
    }
    let has = |name: &str| env::var_os(name).is_some_and(|value| !value.is_empty());
    let is_given = [
        "AWS_ACCESS_KEY_ID",
        "AWS_WEB_IDENTITY_TOKEN_FILE",
        "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
        "AWS_CONTAINER_CREDENTIALS_FULL_URI",
        "AWS_SKIP_SIGNATURE",
    ];
    let profile = Profile::of_environment()?;
    if !is_given.into_iter().any(has) {
        match &profile {
            Some(Profile { key_id: Some(id), secret: Some(secret), token, .. }) => {
                builder = builder.with_access_key_id(id).with_secret_access_key(secret);
                if let Some(token) = token {
                    builder = builder.with_token(token);
                }
            }
            _ if is_machine_of("Amazon EC2") => {}
            _ => {
                return Err(no_credentials(
                    "S3",
                    "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or write them with `aws configure`; for a login, `aws configure \
                     export-credentials --format env` prints them; AWS_SKIP_SIGNATURE=true reads public buckets",
                ));
            }
        }
    }
    let region = profile.and_then(|profile| profile.region);
    let is_known = |key| builder.get_config_value(&key).is_some();
    if !is_known(AmazonS3ConfigKey::Region) && !is_known(AmazonS3ConfigKey::DefaultRegion) {
        let is_aws = !is_known(AmazonS3ConfigKey::Endpoint) && !is_known(AmazonS3ConfigKey::S3Endpoint);
        let region = match region {
            Some(region) => Some(region),
            None if is_aws => Some(wait(resolve_bucket_region(bucket, &options)).map_err(|error| {
                crate::failure::error(format!("s3://{bucket}"), &error)
                    .help("set AWS_REGION to the region of the bucket")
            })?),
            None => None,
        };
        if let Some(region) = region {
            builder = builder.with_region(region);
        }
    }
    let built = builder.with_client_options(options).with_retry(RetryConfig::default()).build();
    built
        .map(|store| Arc::new(store) as _)
        .map_err(|error| invalid(&format!("s3://{bucket}"), &error, "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"))
}

fn gs(bucket: &str) -> Result<Arc<dyn ObjectStore>> {
    let has = |name: &str| env::var_os(name).is_some_and(|value| !value.is_empty());
    let given =
        ["APPLICATION_CREDENTIALS", "SERVICE_ACCOUNT", "SERVICE_ACCOUNT_PATH", "SERVICE_ACCOUNT_KEY", "SKIP_SIGNATURE"];
    let is_given = given.iter().any(|name| has(&format!("GOOGLE_{name}"))) || has("GOOGLE_BEARER_TOKEN");
    let of_user = env::home_dir().map(|home| home.join(".config/gcloud/application_default_credentials.json"));
    if !is_given && !of_user.is_some_and(|file| file.exists()) && !is_machine_of("Google") {
        return Err(no_credentials(
            "Google Cloud Storage",
            "run `gcloud auth application-default login`, or set GOOGLE_APPLICATION_CREDENTIALS to the key file of a service \
             account; GOOGLE_SKIP_SIGNATURE=true reads public buckets",
        ));
    }
    let builder = GoogleCloudStorageBuilder::from_env().with_bucket_name(bucket);
    let built = builder.with_client_options(options(&["GOOGLE_BASE_URL"])).with_retry(RetryConfig::default()).build();
    built
        .map(|store| Arc::new(store) as _)
        .map_err(|error| invalid(&format!("gs://{bucket}"), &error, "GOOGLE_APPLICATION_CREDENTIALS"))
}

fn az(container: &str) -> Result<Arc<dyn ObjectStore>> {
    let has = |name: &str| env::var_os(name).is_some_and(|value| !value.is_empty());
    if !has("AZURE_STORAGE_ACCOUNT_NAME") && !has("AZURE_STORAGE_USE_EMULATOR") {
        return Err(Error::new("AZURE_STORAGE_ACCOUNT_NAME is not set, and the URL names the container alone").help(
            "set AZURE_STORAGE_ACCOUNT_NAME, and AZURE_STORAGE_ACCOUNT_KEY or another credential: AZURE_STORAGE_SAS_TOKEN, \
             AZURE_USE_AZURE_CLI=true after `az login`, or the variables of a workload identity",
        ));
    }
    let builder = MicrosoftAzureBuilder::from_env().with_container_name(container);
    let mut options = options(&["AZURE_STORAGE_ENDPOINT"]);
    if has("AZURE_STORAGE_USE_EMULATOR") {
        options = options.with_allow_http(true);
    }
    let built = builder.with_client_options(options).with_retry(RetryConfig::default()).build();
    built.map(|store| Arc::new(store) as _).map_err(|error| {
        invalid(&format!("az://{container}"), &error, "AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY")
    })
}

/// Whether this machine is one of a cloud, whose own service gives credentials. Elsewhere, a request for them would wait
/// for minutes.
fn is_machine_of(vendor: &str) -> bool {
    ["sys_vendor", "product_name", "board_vendor"].iter().any(|file| {
        let text = std::fs::read_to_string(Path::new("/sys/class/dmi/id").join(file)).unwrap_or_default();
        text.contains(vendor)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_variables_are_named() {
        for server in
            ["http://127.0.0.1:9000", "https://s3.host", "http://[::1]:80/path", "http://[::1]", "https://a-b:1"]
        {
            assert_eq!(check_variable("AWS_ENDPOINT_URL", server), Ok(()), "{server}");
        }
        check_variable("AWS_ENDPOINT_URL", "").expect("like none");
        for wrong in [
            "127.0.0.1:9000",
            "http://",
            "http://host:99999",
            "http://a b",
            "ftp://x",
            "https://:80",
            "http://u:pw@h:x",
        ] {
            let error = check_variable("AWS_ENDPOINT_URL", wrong).expect_err(wrong).to_string();
            assert!(error.contains("AWS_ENDPOINT_URL is `") && !error.contains("pw"), "{error}");
        }
        let error = check_variable("AWS_SECRET_ACCESS_KEY", "secret\n").expect_err("an end of line").to_string();
        assert!(error.contains("AWS_SECRET_ACCESS_KEY") && !error.contains("secret\n"), "{error}");
    }

    #[test]
    fn wrong_urls_are_refused_without_their_secrets() {
        for url in ["s3://", "s3:///x", "s3://key:secret@bucket/x", "s3://bucket?token=secret/x", "az://a b/x"] {
            let error = open(url).expect_err(url).to_string();
            assert!(error.contains("no valid name of a bucket") && !error.contains("secret"), "{error}");
        }
        // Before credentials are looked for.
        let error = open("s3://bucket/../x").expect_err("outside").to_string();
        assert!(error.contains("`..` is a part of it"), "{error}");
    }
}
