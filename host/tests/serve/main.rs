//! `prehend serve`: the service with work that waits for a word (so that every queue is as full as a test wants it), and
//! the real planner behind it, as its clients meet both.
#![allow(clippy::unwrap_used, clippy::panic, reason = "the helpers of these tests are tests themselves")]

mod bounds;
mod described;
mod ending;
mod gated;
mod http;
mod planner;
mod requests;
