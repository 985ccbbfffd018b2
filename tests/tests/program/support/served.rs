//! Pages of `view` and `preview --serve`.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// The address that the program prints: `http://127.0.0.1:8000/5d0c…/?token=91af…`.
pub struct Address {
    pub host: String,
    /// The path of the first page.
    pub own: String,
    pub token: String,
}

impl Address {
    pub fn of(url: &str) -> Self {
        let parts = || {
            let (host, rest) = url.strip_prefix("http://")?.split_once('/')?;
            let (own, token) = rest.split_once("?token=")?;
            Some(Self { host: host.to_owned(), own: format!("/{own}"), token: token.to_owned() })
        };
        let address = parts().unwrap_or_else(|| panic!("{url}"));
        assert!(address.host.starts_with("127.0.0.1:") && address.own.ends_with('/'), "{url}");
        address
    }

    /// The address of a page, for a browser.
    pub fn page(&self, name: &str) -> String {
        format!("http://{}{}{name}?token={}", self.host, self.own, self.token)
    }

    /// Head and body of the answer to a request with the cookie of the first page.
    pub fn get(&self, path: &str, method: &str) -> (String, Vec<u8>) {
        self.ask(
            &format!("{}{}", self.own, path.trim_start_matches('/')),
            method,
            &format!("Cookie: token={}\r\n", self.token),
        )
    }

    /// Head and body of the answer to a request with additional header fields, each with its line ending.
    pub fn ask(&self, target: &str, method: &str, fields: &str) -> (String, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.host).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(240))).expect("a timeout");
        let host = &self.host;
        write!(stream, "{method} {target} HTTP/1.1\r\nHost: {host}\r\n{fields}Connection: close\r\n\r\n")
            .expect("sent");
        let mut all = Vec::new();
        stream.read_to_end(&mut all).expect("answered");
        let end = all.windows(4).position(|bytes| bytes == b"\r\n\r\n").expect("a head");
        (String::from_utf8_lossy(&all[..end]).into_owned(), all[end + 4..].to_vec())
    }
}
