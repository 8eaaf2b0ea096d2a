//! HTTP by hand, so that a test sees what is on the line.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use serde_json::Value;

/// An answer, read to its end.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        self.headers.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        let text = String::from_utf8_lossy(&self.body);
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {} {text}", self.status))
    }

    /// The error of a refusal: one line of JSON.
    #[track_caller]
    pub(crate) fn error(&self) -> String {
        assert!(self.status >= 400, "{self:?}");
        assert_eq!(self.header("content-type"), Some("application/json"));
        let document = self.json();
        assert_eq!(document.as_object().unwrap().len(), 1, "{document}");
        let line = document["error"].as_str().unwrap().to_owned();
        assert!(!line.contains('\n') && !line.is_empty(), "{line}");
        line
    }
}

/// A connection whose reads end some time, so that a test that fails does not hang.
pub(crate) fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    stream
}

/// The head of a request.
pub(crate) fn head(call: &str, headers: &[(&str, &str)]) -> String {
    let mut head = format!("{call} HTTP/1.1\r\n");
    let is_hosted = headers.iter().any(|(name, _)| *name == "host");
    for (name, value) in headers.iter().chain([("host", "localhost")].iter().filter(|_| !is_hosted)) {
        head += &format!("{name}: {value}\r\n");
    }
    head + "\r\n"
}

/// Asks on a connection of its own. `call` is method and target.
pub(crate) fn ask(address: SocketAddr, call: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
    let mut stream = connect(address);
    let length = body.len().to_string();
    let mut all = headers.to_vec();
    if !body.is_empty() {
        all.push(("content-length", &length));
    }
    all.push(("connection", "close"));
    stream.write_all(head(call, &all).as_bytes()).unwrap();
    stream.write_all(body).unwrap();
    answer(&mut BufReader::new(stream))
}

pub(crate) fn get(address: SocketAddr, target: &str) -> Answer {
    ask(address, &format!("GET {target}"), &[], &[])
}

pub(crate) fn post(address: SocketAddr, target: &str, body: &[u8]) -> Answer {
    ask(address, &format!("POST {target}"), &[("content-type", "application/octet-stream")], body)
}

/// Reads one answer.
pub(crate) fn answer(stream: &mut impl BufRead) -> Answer {
    let mut first = String::new();
    stream.read_line(&mut first).unwrap();
    let status = first.split(' ').nth(1).unwrap_or_else(|| panic!("no answer: {first:?}")).parse().unwrap();
    let mut headers = Vec::new();
    loop {
        let mut line = String::new();
        stream.read_line(&mut line).unwrap();
        let Some((name, value)) = line.trim_end().split_once(": ") else { break };
        headers.push((name.to_ascii_lowercase(), value.to_owned()));
    }
    let mut answer = Answer { status, headers, body: Vec::new() };
    match answer.header("content-length").map(|length| length.parse().unwrap()) {
        Some(length) => {
            answer.body.resize(length, 0);
            stream.read_exact(&mut answer.body).unwrap();
        }
        None if answer.header("transfer-encoding") == Some("chunked") => answer.body = chunks(stream),
        None => {}
    }
    answer
}

/// A chunked body; it must end as such bodies do, not by a connection that breaks.
fn chunks(stream: &mut impl BufRead) -> Vec<u8> {
    let mut body = Vec::new();
    loop {
        let mut line = String::new();
        stream.read_line(&mut line).unwrap();
        let length = usize::from_str_radix(line.trim_end(), 16).unwrap();
        let mut chunk = vec![0; length + 2];
        stream.read_exact(&mut chunk).unwrap();
        assert_eq!(&chunk[length..], b"\r\n");
        if length == 0 {
            return body;
        }
        body.extend_from_slice(&chunk[..length]);
    }
}

/// The events of a job to the end of their stream: name and status.
pub(crate) fn events(address: SocketAddr, id: &str) -> Vec<(String, Value)> {
    read_events(follow(address, id))
}

/// A job's stream of events that has begun.
pub(crate) fn follow(address: SocketAddr, id: &str) -> BufReader<TcpStream> {
    let mut stream = connect(address);
    let call = format!("GET /plans/{id}/events");
    stream.write_all(head(&call, &[("connection", "close")]).as_bytes()).unwrap();
    let mut reader = BufReader::new(stream);
    assert!(!reader.fill_buf().unwrap().is_empty());
    reader
}

/// A stream of events to its end.
pub(crate) fn read_events(mut stream: BufReader<TcpStream>) -> Vec<(String, Value)> {
    let answer = answer(&mut stream);
    assert_eq!((answer.status, answer.header("content-type")), (200, Some("text/event-stream")));
    let text = String::from_utf8(answer.body).unwrap();
    let blocks = text.split("\n\n").filter(|block| block.contains("data:"));
    blocks
        .map(|block| {
            let field = |name: &str| {
                let line = block.lines().find(|line| line.starts_with(name)).unwrap();
                line[name.len()..].trim().to_owned()
            };
            (field("event:"), serde_json::from_str(&field("data:")).unwrap())
        })
        .collect()
}

/// The name of a job that was taken.
#[track_caller]
pub(crate) fn taken(answer: &Answer) -> String {
    let text = String::from_utf8_lossy(&answer.body);
    assert_eq!(answer.status, 202, "{text}");
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    assert_eq!(answer.header("location"), Some(format!("/plans/{id}").as_str()));
    id
}
