//! One client at a time: progress in its order, wrong requests, what browsers must not do.

use std::io::{BufReader, Write};
use std::time::Duration;

use host::serve::Limits;

use crate::gated::Running;
use crate::http::{answer, ask, connect, events, get, head, post, taken};

#[test]
fn progress_comes_in_order_and_ends_with_the_plan() {
    let service = Running::with(Limits::default());
    let id = taken(&post(service.address, "/plans?do=steps", b"body"));
    let early = get(service.address, &format!("/plans/{id}/plan.json"));
    assert_eq!((early.status, early.header("retry-after")), (409, Some("1")));
    let followed = std::thread::scope(|scope| {
        let following = [0; 3].map(|_| scope.spawn(|| events(service.address, &id)));
        service.gate.open();
        following.map(|one| one.join().unwrap())
    });
    for events in followed {
        let (last, before) = events.split_last().unwrap();
        assert_eq!((last.0.as_str(), &last.1["state"]), ("done", &"done".into()));
        assert_eq!((&last.1["attempts"], &last.1["grasps"]), (&100.into(), &3.into()));
        assert!(before.iter().all(|(name, _)| name == "progress"), "{before:?}");
        let order = |status: &serde_json::Value| {
            let state = ["waiting", "running", "done"].iter().position(|state| status["state"] == **state);
            (state.unwrap(), status["attempts"].as_u64().unwrap())
        };
        assert!(events.is_sorted_by_key(|(_, status)| order(status)), "{events:?}");
    }
    let plan = get(service.address, &format!("/plans/{id}/plan.json"));
    assert_eq!((plan.status, plan.body.as_slice()), (200, &b"body"[..]));
    // Who comes late is told the end at once.
    assert_eq!(events(service.address, &id).len(), 1);
    assert_eq!(get(service.address, &format!("/plans/{id}")).json()["state"], "done");
}

#[test]
fn jobs_that_fail_say_why_and_the_service_goes_on() {
    let service = Running::with(Limits::default());
    for (word, why) in [("fail", "nothing to hold"), ("panic", "a fault of its own")] {
        let id = taken(&post(service.address, &format!("/plans?do={word}"), b"body"));
        let (name, status) = events(service.address, &id).pop().unwrap();
        assert_eq!((name.as_str(), &status["state"]), ("failed", &"failed".into()));
        assert!(status["error"].as_str().unwrap().contains(why), "{status}");
        for document in ["plan.json", "report"] {
            let refused = get(service.address, &format!("/plans/{id}/{document}"));
            assert_eq!(refused.status, 409);
            assert!(refused.error().contains(why));
        }
    }
    let id = taken(&post(service.address, "/plans", b"body"));
    assert_eq!(events(service.address, &id).pop().unwrap().0, "done");
    // This work draws no page.
    assert_eq!(get(service.address, &format!("/plans/{id}/report")).status, 404);
}

#[test]
fn wrong_requests_get_their_status_and_a_line() {
    let limits = Limits { body_bytes: 1000, body_time: Duration::from_millis(100), ..Limits::default() };
    let service = Running::with(limits);
    let octets = ("content-type", "application/octet-stream");
    let large = [b'x'; 1001];
    for (call, headers, body, status, word) in [
        ("POST /plans", &[octets][..], &b""[..], 400, "the body is empty"),
        ("POST /plans?colour=red", &[octets], b"body", 400, "only the option"),
        ("POST /plans", &[octets], b"bad body", 422, "bad body"),
        ("POST /plans", &[octets], &large, 413, "larger than the 1000 bytes"),
        ("POST /plans", &[("content-type", "application/json")], b"{}", 415, "application/json"),
        ("POST /plans", &[("content-type", "multipart/form-data; boundary=x")], b"--x", 415, "octet-stream"),
        (
            "POST /plans",
            &[("content-type", "application/x-www-form-urlencoded")],
            b"a=b",
            415,
            "octet-stream",
        ),
        ("POST /plans", &[("content-type", "")], b"body", 415, "octet-stream"),
        ("GET /plans", &[], b"", 405, "openapi"),
        ("DELETE /plans/1", &[], b"", 405, "openapi"),
        ("GET /", &[], b"", 404, "openapi"),
        ("GET /plans/", &[], b"", 404, "openapi"),
        ("GET /plans/1", &[], b"", 404, "no such plan"),
        ("GET /plans/..%2f..%2fetc/plan.json", &[], b"", 404, "no such plan"),
        ("GET /plans/%00/events", &[], b"", 404, "no such plan"),
        ("GET /plans/1/report", &[], b"", 404, "no such plan"),
        ("GET /health", &[("host", "evil.example")], b"", 421, "127.0.0.1"),
        ("POST /plans", &[octets, ("origin", "http://evil.example")], b"body", 403, "other sites"),
    ] {
        let refused = ask(service.address, call, headers, body);
        assert_eq!(refused.status, status, "{call} {headers:?}");
        assert!(refused.error().contains(word), "{call} {headers:?}: {}", refused.error());
        assert_eq!(refused.header("allow").is_some(), status == 405, "{call}");
    }
    // Good ones of every kind of name for a file, and for the service.
    for content_type in ["application/octet-stream", "model/stl", "text/plain; charset=utf-8", "TEXT/CSV"] {
        taken(&ask(service.address, "POST /plans", &[("content-type", content_type)], b"body"));
    }
    taken(&ask(service.address, "POST /plans", &[], b"body"));
    let own = service.address.to_string();
    let origin = format!("http://{own}");
    taken(&ask(service.address, "POST /plans", &[("host", &own), ("origin", &origin)], b"body"));
    assert_eq!(get(service.address, "/health").json()["name"], "prehend");
}

#[test]
fn bodies_that_come_too_slowly_or_in_too_many_pieces_are_refused() {
    let limits = Limits { body_bytes: 1000, body_time: Duration::from_millis(100), ..Limits::default() };
    let service = Running::with(limits);
    let mut slow = connect(service.address);
    slow.write_all(head("POST /plans", &[("content-length", "10")]).as_bytes()).unwrap();
    slow.write_all(b"bod").unwrap();
    let refused = answer(&mut BufReader::new(slow));
    assert_eq!(refused.status, 408);
    assert!(refused.error().contains("0.1 s"));
    // Without a length it is counted as it comes.
    let mut chunked = connect(service.address);
    chunked.write_all(head("POST /plans", &[("transfer-encoding", "chunked")]).as_bytes()).unwrap();
    for _ in 0..3 {
        chunked.write_all(format!("190\r\n{}\r\n", "x".repeat(400)).as_bytes()).unwrap();
    }
    assert_eq!(answer(&mut BufReader::new(chunked)).status, 413);
    let mut empty = connect(service.address);
    empty.write_all(head("POST /plans", &[("transfer-encoding", "chunked")]).as_bytes()).unwrap();
    empty.write_all(b"0\r\n\r\n").unwrap();
    let refused = answer(&mut BufReader::new(empty));
    assert_eq!(refused.status, 400);
    assert!(refused.error().contains("the body is empty"));
    // Neither of them keeps its place in the queue.
    assert_eq!(get(service.address, "/health").json()["waiting"], 0);
}

#[test]
fn who_asks_first_need_not_send_what_is_refused() {
    let service = Running::with(Limits { body_bytes: 1000, ..Limits::default() });
    let call = |length: &str| {
        let mut stream = connect(service.address);
        let headers = [("expect", "100-continue"), ("content-length", length), ("connection", "close")];
        stream.write_all(head("POST /plans", &headers).as_bytes()).unwrap();
        let mut reader = BufReader::new(stream.try_clone().unwrap());
        (answer(&mut reader), stream, reader)
    };
    let (refused, ..) = call("100000000");
    assert_eq!(refused.status, 413);
    let (go_on, mut stream, mut reader) = call("4");
    assert_eq!(go_on.status, 100);
    stream.write_all(b"body").unwrap();
    taken(&answer(&mut reader));
}
