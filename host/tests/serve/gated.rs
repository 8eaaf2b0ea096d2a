//! A service in this process whose jobs do what their options say, and wait at a gate.

use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use host::serve::{self, Limits, OptionInfo, Product, Reporter, Work};
use serde_json::json;
use tokio::sync::oneshot;

/// Opened once, for all jobs that wait at it.
#[derive(Clone, Default)]
pub(crate) struct Gate(Arc<(Mutex<bool>, Condvar)>);

impl Gate {
    pub(crate) fn open(&self) {
        *self.0.0.lock().unwrap() = true;
        self.0.1.notify_all();
    }

    /// Returns when it is open, or the job is asked to stop.
    fn wait(&self, reporter: &Reporter) {
        let mut is_open = self.0.0.lock().unwrap();
        while !*is_open && !reporter.stop().is_asked() {
            is_open = self.0.1.wait_timeout(is_open, Duration::from_millis(5)).unwrap().0;
        }
    }
}

/// Work with one option, `do`: `echo` gives the body back as the plan, `steps` does so after a hundred reports, `wait` at
/// the gate, `fail` and `panic` do that.
pub(crate) struct Gated(Gate);

impl Work for Gated {
    type Request = String;
    type Job = (String, Vec<u8>);

    fn options(&self) -> Vec<OptionInfo> {
        let words = ["echo", "steps", "wait", "fail", "panic"].map(str::to_owned).to_vec();
        vec![OptionInfo {
            name: "do".to_owned(),
            description: "What to do".to_owned(),
            default: Some("echo".to_owned()),
            words,
        }]
    }

    fn request(&self, options: &[(String, String)]) -> Result<String, String> {
        match options {
            [] => Ok("echo".to_owned()),
            [(key, word)] if key == "do" => Ok(word.clone()),
            _ => Err("there is only the option 'do'".to_owned()),
        }
    }

    fn needs_body(&self, _: &String) -> bool {
        true
    }

    fn read(&self, word: String, body: Vec<u8>) -> Result<(Self::Job, Vec<String>), String> {
        if body.starts_with(b"bad") { Err("bad body".to_owned()) } else { Ok(((word, body), Vec::new())) }
    }

    fn plan(&self, (word, body): Self::Job, reporter: &Reporter) -> Result<Product, String> {
        reporter.stage("search");
        match word.as_str() {
            "wait" => self.0.wait(reporter),
            "steps" => {
                self.0.wait(reporter);
                (0..=100).for_each(|step| reporter.attempts(step, 100));
            }
            "fail" => return Err("nothing to hold".to_owned()),
            "panic" => panic!("as asked"),
            _ => {}
        }
        Ok(Product { plan: body, grasps: 3, summary: json!({}), ..Product::default() })
    }
}

/// A running service.
pub(crate) struct Running {
    pub(crate) address: SocketAddr,
    pub(crate) gate: Gate,
    end: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    pub(crate) fn with(limits: Limits) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let gate = Gate::default();
        let (end, ended) = oneshot::channel::<()>();
        let work = Gated(gate.clone());
        let thread = std::thread::spawn(move || {
            let ending = async move { drop(ended.await) };
            serve::run(listener, limits, work, |_| (), ending).unwrap();
        });
        Self { address, gate, end: Some(end), thread: Some(thread) }
    }

    /// Asks the service to end, and does not wait for it.
    pub(crate) fn ask_to_end(&mut self) {
        self.end.take().unwrap().send(()).unwrap();
    }

    /// Waits until it has ended.
    pub(crate) fn join(&mut self) {
        self.thread.take().unwrap().join().unwrap();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.gate.open();
        drop(self.end.take());
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking());
        }
    }
}
