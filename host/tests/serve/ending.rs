//! The end of the service: no new jobs, those that run may finish and be fetched, all others are told.

use std::net::TcpStream;
use std::thread;
use std::time::Duration;

use host::serve::Limits;

use crate::gated::Running;
use crate::http::{events, follow, get, post, read_events, taken};

#[test]
fn a_running_job_ends_and_is_fetched_and_waiting_ones_are_told() {
    let mut service = Running::with(Limits { jobs: 1, ..Limits::default() });
    let address = service.address;
    let running = taken(&post(address, "/plans?do=wait", b"body"));
    while get(address, &format!("/plans/{running}")).json()["state"] == "waiting" {}
    let waiting = taken(&post(address, "/plans?do=wait", b"body"));
    let following = follow(address, &running);
    let follower = thread::spawn({
        let running = running.clone();
        move || {
            let last = read_events(following).pop().unwrap().0;
            (last, get(address, &format!("/plans/{running}/plan.json")))
        }
    });
    service.ask_to_end();
    let (name, status) = events(address, &waiting).pop().unwrap();
    assert_eq!(name, "failed");
    assert!(status["error"].as_str().unwrap().contains("shut down"), "{status}");
    let refused = post(address, "/plans", b"body");
    assert_eq!((refused.status, refused.header("retry-after")), (503, Some("120")));
    assert!(refused.error().contains("shut down"));
    service.gate.open();
    let (last, plan) = follower.join().unwrap();
    assert_eq!((last.as_str(), plan.status, plan.body.as_slice()), ("done", 200, &b"body"[..]));
    service.join();
    assert!(TcpStream::connect(address).is_err());
}

#[test]
fn what_outlasts_the_grace_is_told_to_stop() {
    let mut service = Running::with(Limits { grace: Duration::from_millis(1), ..Limits::default() });
    let address = service.address;
    let id = taken(&post(address, "/plans?do=wait", b"body"));
    while get(address, "/health").json()["running"] == 0 {}
    let following = follow(address, &id);
    service.ask_to_end();
    let (name, status) = read_events(following).pop().unwrap();
    assert_eq!(name, "failed");
    assert!(status["error"].as_str().unwrap().contains("shut down"), "{status}");
    service.join();
}
