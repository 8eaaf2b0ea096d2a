//! The planner as a small HTTP service: a cloud or mesh is posted, its plan is followed and fetched.
//!
//! The system of 2005 sends its scans from one computer to another over TCP/IP (Wang et al. 2005, section II); this is
//! that line for whoever speaks HTTP. Which work is done is a [`Work`]'s business, this module knows only bodies,
//! options and plans as bytes. What everything costs is bounded: connections, jobs that wait, the size of a body and
//! the time it may take, the time of a job, the plans that are kept. Whoever comes too many is told so, with
//! `Retry-After`. See `docs/service.md`.

pub mod client;
mod connection;
mod guard;
mod jobs;
mod openapi;
mod refusal;
mod routes;
mod status;

use std::future::Future;
use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;

pub use jobs::Reporter;
pub use status::{State, Status};

use guard::Guard;
use jobs::Jobs;
use routes::Service;

/// Where the service listens unless it is told otherwise: this machine only.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:7580";

/// Bounds of everything that clients can ask for.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Jobs that are computed at the same time. A search uses all cores by itself.
    pub jobs: usize,
    /// Jobs that may wait besides, those whose body is still read among them.
    pub queue: usize,
    /// Jobs that have ended and are kept for their clients.
    pub kept: usize,
    /// Most bytes of kept plans together; the newest one is kept whatever its size.
    pub kept_bytes: usize,
    /// Largest body, bytes.
    pub body_bytes: usize,
    /// How long a body may take to arrive.
    pub body_time: Duration,
    /// How long a job may be computed.
    pub job_time: Duration,
    /// How long running jobs may go on once the service is asked to end.
    pub grace: Duration,
    /// Connections at the same time; those beyond are answered with 503.
    pub connections: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            jobs: 1,
            queue: 16,
            kept: 64,
            kept_bytes: 256 << 20,
            body_bytes: 256 << 20,
            body_time: Duration::from_secs(60),
            job_time: Duration::from_secs(600),
            grace: Duration::from_secs(30),
            connections: 512,
        }
    }
}

/// One option of a job, as the service describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct OptionInfo {
    /// Name in the query.
    pub name: String,
    /// What it means.
    pub description: String,
    /// What it is when it is not given.
    pub default: Option<String>,
    /// The only words that it takes, if it takes words.
    pub words: Vec<String>,
}

/// What a job made.
#[derive(Default)]
pub struct Product {
    /// The plan document, as a file would hold it.
    pub plan: Vec<u8>,
    /// How many grasps it has.
    pub grasps: usize,
    /// What was done, in lines for people.
    pub text: Vec<String>,
    /// The same for machines.
    pub summary: serde_json::Value,
    /// Draws the plan as a page for a browser, and what that keeps in memory, bytes.
    pub page: Option<(Page, usize)>,
}

/// Draws a page of HTML, or says in one line why it cannot.
pub type Page = Arc<dyn Fn() -> Result<String, String> + Send + Sync>;

/// What the service does with a body. Errors are one line, for the client.
pub trait Work: Send + Sync + 'static {
    /// Options that were understood.
    type Request: Send + 'static;
    /// Something to plan on, with its options.
    type Job: Send + 'static;

    /// The options that there are.
    fn options(&self) -> Vec<OptionInfo>;

    /// Reads options. An error is the client's: status 400.
    fn request(&self, options: &[(String, String)]) -> Result<Self::Request, String>;

    /// Whether the request comes with a body, or needs none.
    fn needs_body(&self, request: &Self::Request) -> bool;

    /// Reads the body. An error is the body's: status 422. The second value warns about it, a line each.
    fn read(&self, request: Self::Request, body: Vec<u8>) -> Result<(Self::Job, Vec<String>), String>;

    /// Does the work, on a thread that may block. Returns soon after [`Reporter::stop`] is asked, whatever then.
    fn plan(&self, job: Self::Job, reporter: &Reporter) -> Result<Product, String>;
}

/// Serves until `ending` is ready and what then runs has ended or was told so. `log` is given a line for each job.
///
/// Errors when the runtime or the listener cannot be set up.
pub fn run<W: Work>(
    listener: TcpListener,
    limits: Limits,
    work: W,
    log: impl Fn(&str) + Send + Sync + 'static,
    ending: impl Future<Output = ()>,
) -> io::Result<()> {
    let address = listener.local_addr()?;
    listener.set_nonblocking(true)?;
    // One thread moves bytes; what computes has threads of its own, and rayon's.
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .max_blocking_threads(limits.jobs + limits.queue + SPARE_THREADS)
        .build()?;
    runtime
        .block_on(async {
            let listener = tokio::net::TcpListener::from_std(listener)?;
            let (closed, closing) = watch::channel(false);
            let jobs = Jobs::new(limits.clone(), Box::new(log));
            let service = Arc::new(Service::new(work, Arc::clone(&jobs)));
            let guard = Guard::new(address);
            let accepting = tokio::spawn(connection::accept(
                listener,
                routes::router(service),
                guard,
                limits.connections,
                closing,
            ));
            ending.await;
            // New jobs are refused, and whoever follows an old one can still come for it.
            jobs.end().await;
            let _ = closed.send(true);
            let _ = accepting.await;
            Ok(())
        })
        .inspect(|()| runtime.shutdown_timeout(Duration::from_secs(1)))
}

/// Threads that draw pages.
const SPARE_THREADS: usize = 4;
