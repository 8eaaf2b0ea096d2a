//! Who may ask: no page of another site that happens to be open in a browser on this machine.

use std::net::SocketAddr;

use hyper::header::{HOST, ORIGIN};
use hyper::{HeaderMap, StatusCode};

use super::refusal::Refusal;

/// Checks the names by which the service is called.
///
/// A browser sends requests of any page to any address, loopback among them. It says whose page it was (`Origin`), and
/// by which name it found the address (`Host`): a name that is not the machine's own may have been bent to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Guard {
    is_loopback: bool,
}

impl Guard {
    pub(super) fn new(listening: SocketAddr) -> Self {
        Self { is_loopback: listening.ip().is_loopback() }
    }

    pub(super) fn check(self, headers: &HeaderMap) -> Result<(), Refusal> {
        let text = |name| headers.get(name).map(|value| value.to_str().unwrap_or_default());
        let host = text(HOST);
        if self.is_loopback && host.is_some_and(|host| !is_own_name(host)) {
            return Err(Refusal::new(
                StatusCode::MISDIRECTED_REQUEST,
                "this service listens on loopback only: call it by 127.0.0.1 or localhost",
            ));
        }
        let is_foreign =
            |origin: &str| origin.split_once("://").is_none_or(|(_, authority)| Some(authority) != host);
        if text(ORIGIN).is_some_and(is_foreign) {
            return Err(Refusal::new(
                StatusCode::FORBIDDEN,
                "pages of other sites may not use this service: call it from a program, or from its own pages",
            ));
        }
        Ok(())
    }
}

/// Whether an authority names this machine to itself.
fn is_own_name(authority: &str) -> bool {
    let name = match authority.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => authority,
    };
    let address = name.trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost")
        || address.parse::<std::net::IpAddr>().is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(listening: &str, host: &str, origin: Option<&str>) -> bool {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            headers.insert(ORIGIN, origin.parse().unwrap());
        }
        Guard::new(listening.parse().unwrap()).check(&headers).is_ok()
    }

    #[test]
    fn only_own_names_and_own_pages_may_ask() {
        let (loopback, wide) = ("127.0.0.1:7580", "0.0.0.0:7580");
        for host in ["127.0.0.1:7580", "localhost:7580", "LOCALHOST", "127.0.0.2", "[::1]:80", "[::1]"] {
            assert!(judged(loopback, host, None), "{host}");
        }
        for host in ["evil.example:7580", "127.0.0.1.evil.example", "192.168.0.7:7580", "localhost.evil", ""]
        {
            assert!(!judged(loopback, host, None), "{host}");
            assert!(judged(wide, host, None), "{host}");
        }
        assert!(judged(loopback, "localhost:7580", Some("http://localhost:7580")));
        for origin in ["http://evil.example", "null", "http://localhost:8000", ""] {
            assert!(!judged(loopback, "localhost:7580", Some(origin)), "{origin}");
            assert!(!judged(wide, "workstation:7580", Some(origin)), "{origin}");
        }
    }
}
