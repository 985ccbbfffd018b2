//! Errors of requests, without secrets.

use object_store::Error as Failure;
use object_store::client::{HttpError, HttpErrorKind};
use std::error::Error as _;
use std::io::{self, ErrorKind};
use std::path::Path;
use syntable_model::error::Error;

/// Longest message of a server that an error repeats, characters.
const LONGEST: usize = 300;

/// The error of a request for the object that `name` names.
pub fn error(name: impl AsRef<Path>, failure: &Failure) -> Error {
    let text = chain(failure);
    let (kind, help) = match failure {
        _ if ["NoSuchBucket", "ContainerNotFound"].iter().any(|code| text.contains(code)) => {
            (ErrorKind::NotFound, Some(NOWHERE))
        }
        Failure::NotFound { .. } => (ErrorKind::NotFound, None),
        Failure::AlreadyExists { .. } => (ErrorKind::AlreadyExists, None),
        _ if has_odd_key(failure) => (ErrorKind::InvalidData, Some(ODD_KEY)),
        _ => match denial(failure, &text) {
            Some(help) => (ErrorKind::PermissionDenied, Some(help)),
            None => (ErrorKind::ConnectionAborted, Some(OFFLINE)),
        },
    };
    let error = Error::io(name, &io::Error::new(kind, without_secrets(&text)));
    match help {
        Some(help @ (NOWHERE | ODD_KEY)) => error.help(help).of_request(),
        Some(help) => error.help(help),
        None => error,
    }
}

/// Whether the store denied a request because of its credentials.
pub fn is_denied(failure: &Failure) -> bool {
    denial(failure, &chain(failure)).is_some()
}

/// The remedy for a request that was denied because of its credentials.
fn denial(failure: &Failure, text: &str) -> Option<&'static str> {
    let codes = ["ExpiredToken", "InvalidAccessKeyId", "SignatureDoesNotMatch", "InvalidToken"];
    match failure {
        _ if codes.iter().any(|code| text.contains(code)) => Some(UNKNOWN),
        Failure::Unauthenticated { .. } => Some(UNKNOWN),
        Failure::PermissionDenied { .. } => Some(DENIED),
        _ if text.contains("403 Forbidden") => Some(DENIED),
        // So S3 answers a request for a head with expired credentials.
        _ if text.contains("400 Bad Request") && !text.contains("<Code>") => Some(DENIED),
        _ if text.contains("169.254.169.254") => Some(NONE),
        _ => None,
    }
}

/// Whether the bucket has an object whose key the client cannot express, such as one with an empty part.
fn has_odd_key(failure: &Failure) -> bool {
    let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(failure);
    while let Some(inner) = cause {
        if inner.is::<object_store::path::Error>() {
            return true;
        }
        cause = inner.source();
    }
    false
}

/// Whether the connection broke off within an answer. The client sends a request again only if it got no answer at all.
pub fn is_cut(failure: &Failure) -> bool {
    let mut cause: Option<&(dyn std::error::Error + 'static)> = Some(failure);
    while let Some(inner) = cause {
        if let Some(error) = inner.downcast_ref::<HttpError>() {
            return matches!(error.kind(), HttpErrorKind::Interrupted | HttpErrorKind::Decode | HttpErrorKind::Unknown);
        }
        cause = inner.source();
    }
    false
}

/// The same as an error of reading.
pub fn io_error(failure: &Failure) -> io::Error {
    let kind = match failure {
        Failure::NotFound { .. } => ErrorKind::NotFound,
        Failure::PermissionDenied { .. } | Failure::Unauthenticated { .. } => ErrorKind::PermissionDenied,
        _ => ErrorKind::ConnectionAborted,
    };
    io::Error::new(kind, without_secrets(&chain(failure)))
}

// An answer without a body does not tell why it denies a request.
const DENIED: &str = "these credentials may not do this, or are wrong, or have expired: check the rights of the user, the role \
                      or the key, or get new ones, then run the same command again";
const UNKNOWN: &str = "the credentials are wrong or have expired: get new ones, then run the same command again";
const NONE: &str = "no credentials were found: set the variables of the store, as the chapter on object stores shows";
const NOWHERE: &str = "check the name of the bucket, the region and the endpoint";
const ODD_KEY: &str = "rename the object: no part of a key may be empty, `.` or `..`";
const OFFLINE: &str = "the request failed several times: check the network, the endpoint and the name of the bucket, then run the \
                       same command again";

/// The innermost cause, which has the answer of the server or the network.
fn chain(failure: &Failure) -> String {
    let mut texts = vec![failure.to_string()];
    let mut cause = failure.source();
    while let Some(next) = cause {
        texts.push(next.to_string());
        cause = next.source();
    }
    // Outer messages repeat inner ones.
    let mut said: Vec<String> = Vec::new();
    for text in texts.into_iter().rev() {
        if !said.iter().any(|inner| text.contains(inner.as_str())) {
            said.push(text);
        } else if let Some(last) = said.last_mut().filter(|last| text.contains(last.as_str()) && text.len() < LONGEST) {
            *last = text;
        }
    }
    said.join(": ")
}

/// A message without answers in XML beyond their code and message, and without the values of queries, which sign requests.
fn without_secrets(text: &str) -> String {
    let mut text = match (element(text, "Code"), element(text, "Message")) {
        (Some(code), Some(message)) => format!("{code}: {message}"),
        (Some(code), None) => code.to_owned(),
        _ => text.split('<').next().unwrap_or_default().to_owned(),
    };
    while let Some(at) = text.find('?') {
        let end =
            text[at..].find(|c: char| c.is_whitespace() || c == ')' || c == '"').map_or(text.len(), |end| at + end);
        text.replace_range(at..end, " ");
    }
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let text: String = text.chars().take(LONGEST).collect();
    text.trim_end_matches([':', ' ', '.']).to_owned()
}

/// The text of an element of an answer.
fn element<'t>(text: &'t str, name: &str) -> Option<&'t str> {
    let (_, rest) = text.split_once(&format!("<{name}>"))?;
    Some(rest.split_once('<')?.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_of_answers_tell_the_remedy() {
        let answer = |code: &str| format!("status code: 403: <Error><Code>{code}</Code></Error>").into();
        for (failure, help) in [
            (Failure::PermissionDenied { path: "x".into(), source: answer("ExpiredToken") }, UNKNOWN),
            (Failure::PermissionDenied { path: "x".into(), source: answer("InvalidAccessKeyId") }, UNKNOWN),
            (Failure::PermissionDenied { path: "x".into(), source: answer("AccessDenied") }, DENIED),
            (Failure::Generic { store: "S3", source: answer("ExpiredToken") }, UNKNOWN),
            (Failure::Generic { store: "S3", source: "status code: 400 Bad Request: ".into() }, DENIED),
            (Failure::Generic { store: "S3", source: answer("NoSuchBucket") }, NOWHERE),
            (Failure::NotFound { path: "x".into(), source: answer("NoSuchBucket") }, NOWHERE),
            (Failure::Generic { store: "MicrosoftAzure", source: answer("ContainerNotFound") }, NOWHERE),
            (Failure::Generic { store: "S3", source: answer("InternalError") }, OFFLINE),
        ] {
            let error = error("s3://b/x", &failure).to_string();
            assert!(error.contains(help), "{failure:?}: {error}");
        }
    }

    #[test]
    fn answers_are_repeated_without_keys_and_signatures() {
        let answer = "Error performing PUT https://b.example/x?X-Amz-Signature=abc&X-Amz-Credential=AKIA in 3 ms: \
                      <?xml version=\"1.0\"?><Error><Code>SignatureDoesNotMatch</Code><Message>The signature is \
                      wrong.</Message><AWSAccessKeyId>AKIA</AWSAccessKeyId></Error>";
        assert_eq!(without_secrets(answer), "SignatureDoesNotMatch: The signature is wrong");
        let sent = without_secrets("error sending request for url (https://a.example/x?sig=abc&se=1) : refused");
        assert_eq!(sent, "error sending request for url (https://a.example/x ) : refused");
    }
}
