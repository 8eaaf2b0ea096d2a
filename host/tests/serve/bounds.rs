//! More than the service takes: refused with a word of when to come again, and those that were taken are served.

use std::io::{BufReader, Write};
use std::sync::Barrier;
use std::thread;
use std::time::Duration;

use host::serve::Limits;
use host::serve::client::Client;

use crate::gated::Running;
use crate::http::{Answer, answer, ask, connect, events, get, head, post, taken};

const CLIENTS: usize = 1000;

/// Both ends of a thousand connections are in this process: more files than shells allow by default.
fn allow_files() {
    use rustix::process::{Resource, getrlimit, setrlimit};
    let mut limit = getrlimit(Resource::Nofile);
    if limit.current.is_some_and(|current| current < 4096) {
        limit.current = Some(limit.maximum.map_or(4096, |maximum| maximum.min(4096)));
        setrlimit(Resource::Nofile, limit).unwrap();
    }
}

#[test]
fn of_a_thousand_clients_as_many_are_taken_as_fit_and_all_others_told_so() {
    allow_files();
    let limits = Limits { jobs: 2, queue: 7, kept: 20, ..Limits::default() };
    let service = Running::with(limits);
    let start = Barrier::new(CLIENTS);
    let client = |number: usize| {
        let body = format!("body {number}");
        let length = body.len().to_string();
        let mut stream = connect(service.address);
        // All are connected before the first one asks.
        start.wait();
        let request = head("POST /plans?do=wait", &[("content-length", &length)]) + &body;
        // A connection beyond the bound has its answer already.
        let _ = stream.write_all(request.as_bytes());
        answer(&mut BufReader::new(stream))
    };
    let answers: Vec<Answer> = thread::scope(|scope| {
        let client = &client;
        let clients: Vec<_> = (0..CLIENTS)
            .map(|number| {
                let thread = thread::Builder::new().stack_size(256 << 10);
                thread.spawn_scoped(scope, move || client(number)).unwrap()
            })
            .collect();
        clients.into_iter().map(|client| client.join().unwrap()).collect()
    });
    assert_eq!(answers.len(), CLIENTS);
    let (accepted, refused): (Vec<_>, Vec<_>) = answers.into_iter().partition(|answer| answer.status == 202);
    assert_eq!(accepted.len(), 9);
    for one in &refused {
        assert!([429, 503].contains(&one.status), "{one:?}");
        assert!(one.error().contains("try again in"), "{}", one.error());
        let seconds: u64 = one.header("retry-after").unwrap().parse().unwrap();
        assert!((1..=120).contains(&seconds));
    }
    // Not every one was turned away at the door: there are fewer connections beyond the bound than clients.
    assert!(refused.iter().any(|one| one.status == 429));
    assert_eq!(get(service.address, "/health").json()["waiting"], 7);
    service.gate.open();
    let client = Client::new(&format!("http://{}", service.address));
    for one in &accepted {
        let id = taken(one);
        client.follow(&id, &mut |_| ()).unwrap();
        assert!(client.plan(&id).unwrap().starts_with(b"body "));
    }
    taken(&post(service.address, "/plans", b"body"));
}

#[test]
fn connections_beyond_the_bound_are_told_so() {
    let service = Running::with(Limits { connections: 2, ..Limits::default() });
    // Two that are served and stay open.
    let open = [0; 2].map(|_| {
        let mut stream = connect(service.address);
        stream.write_all(head("GET /health", &[]).as_bytes()).unwrap();
        assert_eq!(answer(&mut BufReader::new(&stream)).status, 200);
        stream
    });
    let refused = get(service.address, "/health");
    assert_eq!((refused.status, refused.header("retry-after")), (503, Some("1")));
    assert!(refused.error().contains("try again in 1 s"));
    // A file that is being sent does not tear the answer off.
    let refused = ask(service.address, "POST /plans", &[], &vec![b'x'; 8 << 20]);
    assert_eq!(refused.status, 503);
    drop(open);
    // Their places are free as soon as the service has seen them go.
    while get(service.address, "/health").status == 503 {}
}

#[test]
fn refusals_reach_clients_that_are_still_sending() {
    let service = Running::with(Limits { body_bytes: 1000, ..Limits::default() });
    for _ in 0..20 {
        assert_eq!(ask(service.address, "POST /plans", &[], &vec![b'x'; 8 << 20]).status, 413);
    }
}

#[test]
fn a_job_out_of_time_fails_and_makes_room() {
    let limits = Limits { jobs: 1, queue: 0, job_time: Duration::from_millis(50), ..Limits::default() };
    let service = Running::with(limits);
    let id = taken(&post(service.address, "/plans?do=wait", b"body"));
    let (name, status) = events(service.address, &id).pop().unwrap();
    assert_eq!(name, "failed");
    assert!(status["error"].as_str().unwrap().contains("longer than the 0.05 s"), "{status}");
    // The one place is free once the job has heard that it is to stop.
    let mut next = post(service.address, "/plans?do=fail", b"body");
    while next.status == 429 {
        next = post(service.address, "/plans?do=fail", b"body");
    }
    taken(&next);
}

#[test]
fn only_the_last_plans_are_kept() {
    let small = Running::with(Limits { kept: 2, ..Limits::default() });
    let bytes = Running::with(Limits { kept_bytes: 250, ..Limits::default() });
    for service in [small, bytes] {
        let body = [b'x'; 100];
        let ids: Vec<String> = (0..4)
            .map(|_| {
                let id = taken(&post(service.address, "/plans", &body));
                events(service.address, &id);
                id
            })
            .collect();
        // The last is put on the shelf, and the oldest taken off, just after its followers have heard of it.
        while get(service.address, &format!("/plans/{}", ids[1])).status == 200 {}
        let found: Vec<u16> =
            ids.iter().map(|id| get(service.address, &format!("/plans/{id}/plan.json")).status).collect();
        assert_eq!(found, [404, 404, 200, 200]);
    }
    // One that is larger than all that may be kept is kept for its client.
    let service = Running::with(Limits { kept_bytes: 10, ..Limits::default() });
    let id = taken(&post(service.address, "/plans", &[b'x'; 100]));
    events(service.address, &id);
    assert_eq!(get(service.address, &format!("/plans/{id}/plan.json")).status, 200);
}
