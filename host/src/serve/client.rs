//! The other end: sends a file, follows the job, fetches the plan.

use std::io::{BufRead, BufReader, Read};
use std::thread;
use std::time::Duration;

use thiserror::Error;
use ureq::Agent;
use ureq::http::Response;
use ureq::{Body, http};

use super::{State, Status};

/// How long the service may take to be reached, and to answer once it has everything.
const CONNECT_TIME: Duration = Duration::from_secs(10);
const ANSWER_TIME: Duration = Duration::from_secs(120);
/// How long one stream of events is listened to before it is asked for anew: a machine that vanished says nothing.
const FOLLOW_TIME: Duration = Duration::from_secs(60);
/// Pause before the next one.
const PAUSE: Duration = Duration::from_millis(100);
/// Streams in a row that may break before they said anything.
const BROKEN_STREAMS: usize = 3;
/// Largest plan and largest event that are taken, bytes.
const MAX_PLAN_BYTES: u64 = 1 << 30;
const MAX_EVENT_BYTES: u64 = 1 << 24;

/// Why there is no plan from a service.
#[derive(Debug, Error)]
pub enum ClientError {
    /// Nobody answers, or not in HTTP.
    #[error("no service answers at {url} (is prehend serve running there?): {source}")]
    Unreachable {
        /// The service.
        url: String,
        /// What the line says.
        source: Box<ureq::Error>,
    },
    /// The service refuses.
    #[error("{url} refuses: {message}")]
    Refused {
        /// The service.
        url: String,
        /// Its own line.
        message: String,
    },
    /// The job failed.
    #[error("{url}: {message}")]
    Failed {
        /// The service.
        url: String,
        /// Its own line.
        message: String,
    },
    /// What answers is not this service.
    #[error("{url} does not answer like prehend serve: {what}")]
    Foreign {
        /// The service.
        url: String,
        /// What is amiss.
        what: String,
    },
}

/// A service at an address like `http://127.0.0.1:7580`.
pub struct Client {
    agent: Agent,
    url: String,
}

impl Client {
    /// A client of the service at `url`, which has no path. Nothing is sent yet.
    #[must_use]
    pub fn new(url: &str) -> Self {
        let config = Agent::config_builder()
            .http_status_as_error(false)
            // The line to a workstation is direct, whatever the shell says of the way to the internet.
            .proxy(None)
            .max_redirects(0)
            .timeout_connect(Some(CONNECT_TIME))
            .timeout_recv_response(Some(ANSWER_TIME))
            .user_agent(concat!("prehend/", env!("CARGO_PKG_VERSION")))
            .build();
        Self { agent: config.into(), url: url.trim_end_matches('/').to_owned() }
    }

    /// Sends a file, or nothing if an option names a built-in object. Returns the job as the service took it.
    pub fn submit(&self, options: &[(String, String)], file: Option<&[u8]>) -> Result<Status, ClientError> {
        let query: String = form_urlencoded::Serializer::new(String::new()).extend_pairs(options).finish();
        let request = self.agent.post(format!("{}/plans?{query}", self.url));
        let answer = match file {
            // A service that refuses need not be sent everything first.
            Some(bytes) => request
                .header(http::header::CONTENT_TYPE, "application/octet-stream")
                .header(http::header::EXPECT, "100-continue")
                .send(bytes),
            None => request.send_empty(),
        };
        let mut answer = self.accepted(answer)?;
        let text = answer.body_mut().read_to_string().map_err(|error| self.unreachable(error))?;
        serde_json::from_str(&text).map_err(|error| self.foreign(error))
    }

    /// Follows a job to its end, telling each status that comes by. Errors when it fails.
    pub fn follow(&self, id: &str, told: &mut dyn FnMut(&Status)) -> Result<Status, ClientError> {
        let mut broken = 0;
        loop {
            let request = self.agent.get(format!("{}/plans/{id}/events", self.url));
            let request = request.config().timeout_recv_body(Some(FOLLOW_TIME)).build();
            let mut answer = self.accepted(request.call())?;
            let reader = answer.body_mut().with_config().limit(u64::MAX).reader();
            let mut events = Events(BufReader::new(reader));
            let mut count = 0;
            while let Some(data) = events.next_data() {
                let status: Status = serde_json::from_str(&data).map_err(|error| self.foreign(error))?;
                count += 1;
                told(&status);
                match status.state {
                    State::Waiting | State::Running => {}
                    State::Done => return Ok(status),
                    State::Failed => {
                        let message = status.error.unwrap_or_default();
                        return Err(ClientError::Failed { url: self.url.clone(), message });
                    }
                }
            }
            // The stream broke, or its time was up: the next one begins with where the job is by then.
            broken = if count == 0 { broken + 1 } else { 0 };
            if broken == BROKEN_STREAMS {
                return Err(self.foreign("its events break off"));
            }
            thread::sleep(PAUSE);
        }
    }

    /// The bytes of a plan that is done.
    pub fn plan(&self, id: &str) -> Result<Vec<u8>, ClientError> {
        let mut answer =
            self.accepted(self.agent.get(format!("{}/plans/{id}/plan.json", self.url)).call())?;
        let body = answer.body_mut().with_config().limit(MAX_PLAN_BYTES);
        body.read_to_vec().map_err(|error| self.unreachable(error))
    }

    /// The answer, if it is no refusal.
    fn accepted(&self, answer: Result<Response<Body>, ureq::Error>) -> Result<Response<Body>, ClientError> {
        let mut answer = answer.map_err(|error| self.unreachable(error))?;
        if answer.status().is_success() {
            return Ok(answer);
        }
        let text = answer.body_mut().read_to_string().unwrap_or_default();
        let document: Option<serde_json::Value> = serde_json::from_str(&text).ok();
        match document.as_ref().and_then(|document| document["error"].as_str()) {
            Some(message) => Err(ClientError::Refused { url: self.url.clone(), message: message.to_owned() }),
            None => Err(self.foreign(format!("status {}", answer.status()))),
        }
    }

    fn unreachable(&self, source: ureq::Error) -> ClientError {
        ClientError::Unreachable { url: self.url.clone(), source: Box::new(source) }
    }

    fn foreign(&self, what: impl ToString) -> ClientError {
        ClientError::Foreign { url: self.url.clone(), what: what.to_string() }
    }
}

/// A stream of server-sent events (WHATWG HTML, section 9.2), as far as this service uses them: one line of data each.
struct Events<R>(R);

impl<R: BufRead> Events<R> {
    /// The data of the next event; `None` when the stream ends or breaks.
    fn next_data(&mut self) -> Option<String> {
        loop {
            let mut line = String::new();
            let count = self.0.by_ref().take(MAX_EVENT_BYTES).read_line(&mut line).ok()?;
            if count == 0 || !line.ends_with('\n') {
                return None;
            }
            if let Some(data) = line.strip_prefix("data:") {
                return Some(data.trim().to_owned());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_read_and_broken_ones_dropped() {
        let text =
            ": hello\n\nevent: progress\ndata: {\"a\":1}\n\n:\n\nevent: done\ndata:{\"a\":2}\n\ndata: {\"a\"";
        let mut events = Events(text.as_bytes());
        assert_eq!(events.next_data().as_deref(), Some("{\"a\":1}"));
        assert_eq!(events.next_data().as_deref(), Some("{\"a\":2}"));
        assert_eq!(events.next_data(), None);
    }
}
