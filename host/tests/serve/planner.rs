//! The real planner behind the service: the same bytes as without it, and the same refusals.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Output, Stdio};

use crate::http::{events, get, post, taken};

/// A box of 50 mm.
const BOX_OFF: &str = "OFF\n8 6 0\n-25 -25 0\n25 -25 0\n25 25 0\n-25 25 0\n-25 -25 50\n25 -25 50\n25 25 50\n-25 25 50\n\
    4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n";

fn prehend(folder: &Path, call: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_prehend"));
    command.current_dir(folder).args(call).stdin(Stdio::null()).env_remove("CLICOLOR_FORCE");
    command.output().unwrap()
}

/// `prehend serve` as a process, at a port of its own.
struct Served {
    child: Child,
    stdout: BufReader<ChildStdout>,
    address: SocketAddr,
    /// For `--server`.
    url: String,
}

impl Served {
    fn with(options: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_prehend"));
        command.args(["serve", "--listen", "127.0.0.1:0"]).args(options);
        let mut child =
            command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        stdout.read_line(&mut line).unwrap();
        let url = line.trim().strip_prefix("listening on ").unwrap().to_owned();
        let address = url.strip_prefix("http://").unwrap().parse().unwrap();
        Self { child, stdout, address, url }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_served_plan_is_the_local_one_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("box.off"), BOX_OFF).unwrap();
    assert!(prehend(at, &["scan", "--virtual", "cube", "-o", "cloud.ply"]).status.success());
    let service = Served::with(&[]);
    for call in [
        "plan cube --strategy paper",
        "plan box.off --unit mm --attempts 300 --top 3",
        "plan cloud.ply --strategy paper --pick largest",
        "plan box.off --unit mm --strategy paper --attempts 40 --threshold 0.3 --friction 0.55 --mass 0.25 \
         --candidates quadpod,nip --arm none --table none --place cell --up -1,0,0.5 --pick -1,2,3e-7 --all --seed 7",
        "plan box.off --unit mm --strategy paper --attempts 30 --table -0.02 --place base --start 0,0,90,0,90,0",
        // An honest no.
        "plan cube --strategy paper --friction 0 --attempts 20",
    ] {
        let words: Vec<&str> = call.split_whitespace().collect();
        let local = prehend(at, &[&words[..], &["-o", "local.json"]].concat());
        let remote = prehend(at, &[&words[..], &["-o", "remote.json", "--server", &service.url]].concat());
        let said = String::from_utf8_lossy(&remote.stderr);
        assert_eq!(local.status.code(), remote.status.code(), "{call}: {said}");
        assert_eq!(local.stderr, remote.stderr, "{call}");
        assert!(
            fs::read(at.join("local.json")).unwrap() == fs::read(at.join("remote.json")).unwrap(),
            "{call}"
        );
        // The same is told, but for what it took.
        let lines = |output: &Output| -> Vec<String> {
            let text = String::from_utf8(output.stdout.clone()).unwrap();
            text.lines().filter(|line| !line.contains(" s")).map(str::to_owned).collect()
        };
        assert!(!lines(&local).is_empty());
        assert_eq!(lines(&local), lines(&remote), "{call}");
    }
    let call = ["plan", "cube", "--strategy", "paper", "-o", "-"];
    let remote = prehend(at, &[&call[..], &["--server", &service.url]].concat());
    assert!(prehend(at, &call).stdout == remote.stdout);
    let call = ["plan", "cube", "--strategy", "paper", "--json", "-o", "x.json", "--server", &service.url];
    let summary: serde_json::Value = serde_json::from_slice(&prehend(at, &call).stdout).unwrap();
    assert!(summary["grasps"].as_u64().unwrap() > 0 && summary["seconds"]["total"].is_number(), "{summary}");
}

#[test]
fn wrong_bodies_and_options_are_refused_as_plan_refuses_them() {
    let service = Served::with(&["--max-body", "1"]);
    let good = BOX_OFF.as_bytes();
    let large = vec![b' '; (1 << 20) + 1];
    let garbage: Vec<u8> = (0..2000u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    for (target, body, status, word) in [
        ("/plans", &b""[..], 400, "the body is empty"),
        ("/plans", &garbage, 422, "upload"),
        ("/plans?name=part.stl", &garbage, 422, "part.stl"),
        ("/plans", b"what is this", 422, "upload"),
        ("/plans?name=a.off", b"OFF\n3 1 0\n0 0 0\nnan 0 0\n0 0.05 0\n3 0 1 2\n", 422, "a.off: OFF, line 4"),
        ("/plans?name=none.ply", b"ply\nformat", 422, "none.ply"),
        ("/plans", &large, 413, "larger than the 1048576 bytes"),
        ("/plans?colour=red", good, 400, "'colour'"),
        ("/plans?output=x.json", good, 400, "'output'"),
        ("/plans?server=http://x:1", good, 400, "'server'"),
        ("/plans?schema=true", good, 400, "'schema'"),
        ("/plans?help=", good, 400, "'help'"),
        ("/plans?friction=-1", good, 400, "'-1' for '--friction"),
        ("/plans?friction=NaN", good, 400, "'NaN' for '--friction"),
        ("/plans?friction=1e999", good, 400, "'1e999' for '--friction"),
        ("/plans?friction=", good, 400, "--friction"),
        ("/plans?friction=1&friction=2", good, 400, "--friction"),
        ("/plans?attempts=0", good, 400, "'0' for '--attempts"),
        ("/plans?attempts=99999999999", good, 400, "--attempts"),
        ("/plans?strategy=worst", good, 400, "[possible values: paper, best]"),
        ("/plans?unit=inch", good, 400, "'inch'"),
        ("/plans?all=perhaps", good, 400, "all: give true or false"),
        ("/plans?name=", good, 400, "name: give a name"),
        ("/plans?name=a%0Ab", good, 400, "name: give a name"),
        ("/plans?name=a&name=b", good, 400, "name: give it once"),
        ("/plans?name=a&object=cube", good, 400, "give name for a file"),
        ("/plans?object=cube", good, 400, "without a body"),
        ("/plans?object=%2Fetc%2Fpasswd", b"", 400, "passwd"),
        ("/plans?hand=/etc/x.urdf", good, 400, "hand: only hit-dlr"),
        ("/plans?hand-config=/etc/x.toml", good, 400, "'hand-config'"),
        ("/plans?arm=/etc/x.toml", good, 400, "arm: only rx60 or none"),
    ] {
        let refused = post(service.address, target, body);
        assert_eq!(refused.status, status, "{target}: {}", refused.error());
        assert!(refused.error().contains(word), "{target}: {}", refused.error());
    }
    // What only planning finds out ends the job, not the request.
    for (target, body, word) in [
        ("/plans?candidates=hook", good, "there is no 'hook'"),
        ("/plans?name=three.xyz", b"0 0 0\n0.1 0 0\n0 0.1 0\n", "three.xyz"),
        ("/plans?unit=mm&start=999,0,0,0,0,0", good, "--start: axis 1"),
    ] {
        let (name, status) =
            events(service.address, &taken(&post(service.address, target, body))).pop().unwrap();
        assert_eq!(name, "failed", "{target}");
        assert!(status["error"].as_str().unwrap().contains(word), "{target}: {status}");
    }
    let words = get(service.address, "/openapi.json").json().to_string();
    for option in
        ["friction", "strategy", "candidates", "up", "pick", "object", "name", "seed", "place", "all"]
    {
        assert!(words.contains(&format!("\"name\":\"{option}\"")), "{option}");
    }
    assert!(!words.contains("\"name\":\"output\"") && !words.contains("\"name\":\"\""));
}

#[test]
fn a_job_and_its_page_by_hand() {
    let service = Served::with(&["--time-limit", "300"]);
    // Names that are options, paths or markup elsewhere are names here.
    for name in ["--help", "/etc/passwd", "<script>alert(1)</script>", "cube"] {
        let encoded: String = name.bytes().map(|byte| format!("%{byte:02x}")).collect();
        let target = format!("/plans?unit=mm&strategy=paper&attempts=60&top=2&name={encoded}");
        let id = taken(&post(service.address, &target, BOX_OFF.as_bytes()));
        let (last, status) = events(service.address, &id).pop().unwrap();
        assert_eq!(last, "done", "{status}");
        let plan = get(service.address, &format!("/plans/{id}/plan.json")).json();
        assert_eq!(plan["object"]["source"], name);
        let page = get(service.address, &format!("/plans/{id}/report"));
        assert_eq!((page.status, page.header("content-type")), (200, Some("text/html; charset=utf-8")));
        let html = String::from_utf8(page.body).unwrap();
        assert!(html.starts_with("<!doctype html>") && !html.contains("<script>alert"));
    }
}

#[test]
fn out_of_time_the_search_stops() {
    let service = Served::with(&["--time-limit", "0.3"]);
    let target = "/plans?object=cube&attempts=10000000";
    let id = taken(&post(service.address, target, b""));
    let (last, status) = events(service.address, &id).pop().unwrap();
    assert_eq!(last, "failed");
    assert!(status["error"].as_str().unwrap().contains("longer than the 0.3 s"), "{status}");
    // Ten million attempts take an hour; the next job has its turn because the search has heard of its end.
    let id = taken(&post(service.address, "/plans?object=cube&candidates=hook", b""));
    let (_, status) = events(service.address, &id).pop().unwrap();
    assert!(status["error"].as_str().unwrap().contains("'hook'"), "{status}");
}

#[test]
fn nobody_there_is_one_line_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("box.off"), BOX_OFF).unwrap();
    let refusing = Served::with(&["--max-body", "1"]);
    fs::write(at.join("large.off"), vec![b' '; 3 << 20]).unwrap();
    fs::write(at.join("garbage.off"), "OFF\nnonsense\n").unwrap();
    for (input, url, word) in [
        ("box.off", "http://127.0.0.1:1", "is prehend serve running there?"),
        ("none.off", "http://127.0.0.1:1", "none.off: no such file"),
        ("large.off", refusing.url.as_str(), "refuses: larger than the 1048576 bytes"),
        ("garbage.off", refusing.url.as_str(), "garbage.off"),
    ] {
        let ran = prehend(at, &["plan", input, "-o", "new.json", "--server", url]);
        let said = String::from_utf8(ran.stderr).unwrap();
        assert_eq!(ran.status.code(), Some(2), "{said}");
        assert!(said.starts_with("error: ") && said.lines().count() == 1, "{said}");
        assert!(said.contains(word), "{said}");
        assert!(ran.stdout.is_empty() && !at.join("new.json").exists());
    }
}

#[cfg(unix)]
#[test]
fn signals_end_it_in_good_order() {
    use rustix::process::{Pid, Signal, kill_process};
    for signal in [Signal::TERM, Signal::INT] {
        let mut service = Served::with(&[]);
        kill_process(Pid::from_child(&service.child), signal).unwrap();
        let mut rest = String::new();
        service.stdout.read_to_string(&mut rest).unwrap();
        assert_eq!((service.child.wait().unwrap().code(), rest.as_str()), (Some(0), "ended\n"));
    }
    // An address that is taken is one line.
    let service = Served::with(&[]);
    let folder = tempfile::tempdir().unwrap();
    let ran = prehend(folder.path(), &["serve", "--listen", &service.address.to_string()]);
    let said = String::from_utf8(ran.stderr).unwrap();
    assert_eq!(ran.status.code(), Some(2));
    assert!(said.starts_with("error: listening on ") && said.lines().count() == 1, "{said}");
}
