//! Stores that URLs name, such as `s3://bucket/folder`. Crates register their schemes with
//! [`register_store!`](crate::register_store).

use crate::error::{Error, Result};
use crate::store::StoreFolder;
use std::path::Path;

/// Schemes of URLs, and the stores that they name.
pub struct StoreScheme {
    /// The schemes, such as `s3`.
    pub schemes: &'static [&'static str],
    /// Opens the folder that a URL names. No request reads it.
    pub open: fn(&str) -> Result<StoreFolder>,
    /// Crate that registers them.
    pub crate_name: &'static str,
}

inventory::collect!(StoreScheme);

/// Schemes that a crate of this repository registers, which a program may lack.
const STOCK: [(&[&str], &str); 1] = [(&["s3", "gs", "az"], "object-store")];

/// Whether a name is a URL, and not a path of this machine.
pub fn is_url(name: &str) -> bool {
    scheme_of(name).is_some()
}

fn scheme_of(name: &str) -> Option<&str> {
    let (scheme, _) = name.split_once("://")?;
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme.then_some(scheme)
}

/// The scheme of a URL whose slashes were joined, as types for paths do.
fn joined(path: &str) -> Option<&'static str> {
    let (scheme, rest) = path.split_once(":/").filter(|(_, rest)| !rest.starts_with('/'))?;
    STOCK.iter().flat_map(|(schemes, _)| *schemes).copied().find(|it| *it == scheme).filter(|_| !rest.is_empty())
}

impl StoreFolder {
    /// The folder at a path of this machine, or at a URL. It need not exist. No request reads it.
    ///
    /// # Errors
    /// If no linked crate knows the scheme of the URL, the URL is not valid, or credentials are missing. Errors of the
    /// network are transient.
    pub fn at(name: impl AsRef<Path>) -> Result<Self> {
        let path = name.as_ref();
        if let Some(scheme) = path.to_str().and_then(joined) {
            let message = format!("`{}` was a URL of the scheme `{scheme}`, and lost a `/` as a path", path.display());
            return Err(Error::new(message).help(format!("pass `{scheme}://...` as text")).of_request());
        }
        let Some((name, scheme)) = path.to_str().and_then(|name| Some((name, scheme_of(name)?))) else {
            return Ok(path.into());
        };
        let mut known: Vec<&StoreScheme> = inventory::iter::<StoreScheme>.into_iter().collect();
        known.sort_by_key(|it| it.crate_name);
        if let Some(it) = known.iter().find(|it| it.schemes.contains(&scheme)) {
            // Joined paths have backslashes on Windows.
            let name = if cfg!(windows) { name.replace('\\', "/") } else { name.to_owned() };
            return (it.open)(&name);
        }
        let error = Error::new(format!("`{name}`: URLs of the scheme `{scheme}` name no store")).of_request();
        if let Some((_, feature)) = STOCK.iter().find(|(schemes, _)| schemes.contains(&scheme)) {
            return Err(error.help(format!("this program was built without the feature `{feature}`")));
        }
        let schemes: Vec<String> = known.iter().flat_map(|it| it.schemes).map(|it| format!("`{it}://`")).collect();
        Err(error.help(match schemes.is_empty() {
            true => "write the path of a folder".to_owned(),
            false => format!("write the path of a folder, or a URL that begins with {}", schemes.join(", ")),
        }))
    }
}

/// Registers schemes of the crate that calls it.
#[macro_export]
macro_rules! register_store {
    ($schemes:expr, $open:expr) => {
        $crate::inventory::submit! {
            $crate::store::StoreScheme { schemes: $schemes, open: $open, crate_name: env!("CARGO_PKG_NAME") }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_no_urls() {
        for path in ["data", "/tmp/x", "C:\\x", "a:b", "./s3:/x", "1s://x", "a b://x", "./s3://x"] {
            assert!(!is_url(path) && StoreFolder::at(path).is_ok_and(|folder| folder.local().is_some()), "{path}");
        }
        let error = StoreFolder::at("s3://bucket/x").expect_err("not linked here").to_string();
        assert!(error.contains("`s3://bucket/x`") && error.contains("feature `object-store`"), "{error}");
        let error = StoreFolder::at("s3:/bucket/x").expect_err("joined").to_string();
        assert!(error.contains("lost a `/`") && error.contains("s3://"), "{error}");
        let error = StoreFolder::at("ftp://host/x").expect_err("unknown").to_string();
        assert!(error.contains("`ftp`") && error.contains("path of a folder"), "{error}");
    }
}
