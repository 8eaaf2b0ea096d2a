//! What is told of a job.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// How far a job is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// In the queue.
    Waiting,
    /// Being computed.
    Running,
    /// There is a plan; it may hold no grasp.
    Done,
    /// There is none, and `error` says why.
    Failed,
}

impl State {
    /// Whether nothing more will happen.
    #[must_use]
    pub fn is_end(self) -> bool {
        matches!(self, Self::Done | Self::Failed)
    }
}

/// A job as its client sees it: the document of `GET /plans/{id}`, and the data of every event.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Status {
    /// Name of the job in the service's addresses.
    pub id: String,
    /// How far it is.
    pub state: State,
    /// What is being done, while it runs.
    pub stage: Option<String>,
    /// Attempts of the search so far.
    pub attempts: usize,
    /// Most attempts that it will make.
    pub attempts_asked: usize,
    /// Grasps in the plan, once there is one.
    pub grasps: Option<usize>,
    /// Why there is no plan, in one line.
    pub error: Option<String>,
    /// Doubts about the file that was sent, a line each.
    pub warnings: Vec<String>,
    /// What was done, in lines for people, once it is done.
    pub text: Vec<String>,
    /// The same for machines: the document of `prehend plan --json`.
    pub summary: Option<Value>,
}

impl Status {
    /// A job that waits.
    pub(super) fn waiting(id: String, warnings: Vec<String>) -> Self {
        Self {
            id,
            state: State::Waiting,
            stage: None,
            attempts: 0,
            attempts_asked: 0,
            grasps: None,
            error: None,
            warnings,
            text: Vec::new(),
            summary: None,
        }
    }
}
