//! Jobs: taken in, computed a few at a time, kept for their clients for a while.

use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use hyper::StatusCode;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::{JoinHandle, spawn_blocking};
use tokio::time::sleep;

use super::refusal::{INTERNAL, Refusal};
use super::{Limits, Product, State, Status, Work};
use crate::plan::search::Stop;

/// How long clients may take to fetch what was done while the service was ending.
const FETCHING: Duration = Duration::from_secs(5);

/// Longest time that a client is asked to wait before it comes again, seconds.
const MAX_RETRY_S: u64 = 120;

/// Said of jobs that the end of the service cuts off.
const ENDING: &str = "the service is being shut down: send it again when it is back";

/// One job. Its status is a single value that followers look at whenever it changes: a slow one misses steps of the
/// progress, costs no memory, and never misses the end.
pub(super) struct Job {
    pub(super) status: watch::Sender<Status>,
    product: OnceLock<Product>,
    stop: Stop,
    fetched: AtomicBool,
}

impl Job {
    /// What it made, once its state is done.
    pub(super) fn product(&self) -> Option<&Product> {
        self.product.get()
    }

    /// Notes that its client has what it came for.
    pub(super) fn fetched(&self) {
        self.fetched.store(true, Ordering::Relaxed);
    }

    /// Changes the status of a job that has not ended.
    fn change(&self, change: impl FnOnce(&mut Status)) {
        self.status.send_if_modified(|status| {
            let is_open = !status.state.is_end();
            if is_open {
                change(status);
            }
            is_open
        });
    }

    fn end(&self, outcome: Result<Product, String>) {
        match outcome {
            Ok(mut product) => {
                let (grasps, text) = (product.grasps, std::mem::take(&mut product.text));
                let summary = std::mem::take(&mut product.summary);
                // The plan is there before anybody is told so.
                let _ = self.product.set(product);
                self.change(|status| {
                    *status = Status {
                        state: State::Done,
                        stage: None,
                        grasps: Some(grasps),
                        text,
                        summary: Some(summary),
                        ..status.clone()
                    };
                });
            }
            Err(error) => self.change(|status| {
                status.state = State::Failed;
                status.stage = None;
                status.error = Some(error);
            }),
        }
    }

    /// What keeping it costs, bytes, as far as it is much.
    fn held_bytes(&self) -> usize {
        self.product
            .get()
            .map_or(0, |product| product.plan.len() + product.page.as_ref().map_or(0, |(_, bytes)| *bytes))
    }
}

/// Tells how far a job is, and hears whether it is to end.
pub struct Reporter(Arc<Job>);

impl Reporter {
    /// Names what is being done.
    pub fn stage(&self, name: &str) {
        self.0.change(|status| status.stage = Some(name.to_owned()));
    }

    /// Tells the attempts of the search, so far and at most.
    pub fn attempts(&self, so_far: usize, at_most: usize) {
        self.0.change(|status| {
            status.attempts = status.attempts.max(so_far);
            status.attempts_asked = at_most;
        });
    }

    /// Asked when the job is out of time, or the service is ending.
    #[must_use]
    pub fn stop(&self) -> &Stop {
        &self.0.stop
    }
}

/// All jobs.
pub(super) struct Jobs {
    pub(super) limits: Limits,
    log: Box<dyn Fn(&str) + Send + Sync>,
    /// One for each job that waits or runs.
    slots: Arc<Semaphore>,
    /// One for each job that runs; who waits longest is next.
    running: Arc<Semaphore>,
    shelf: Mutex<Shelf>,
    phase: watch::Sender<Phase>,
    /// What the last job took, milliseconds.
    last_ms: AtomicU64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
enum Phase {
    Open,
    /// No new jobs; those that run may end.
    Ending,
    /// Those that still run are told to stop.
    Cut,
}

#[derive(Default)]
struct Shelf {
    jobs: HashMap<String, Arc<Job>>,
    /// Names of those that have ended, oldest first, and what they hold.
    ended: VecDeque<(String, usize)>,
    ended_bytes: usize,
}

/// How many jobs there are.
pub(super) struct Counts {
    pub(super) waiting: usize,
    pub(super) running: usize,
    pub(super) kept: usize,
}

impl Jobs {
    pub(super) fn new(limits: Limits, log: Box<dyn Fn(&str) + Send + Sync>) -> Arc<Self> {
        Arc::new(Self {
            slots: Arc::new(Semaphore::new(limits.jobs + limits.queue)),
            running: Arc::new(Semaphore::new(limits.jobs)),
            shelf: Mutex::default(),
            phase: watch::Sender::new(Phase::Open),
            last_ms: AtomicU64::new(0),
            limits,
            log,
        })
    }

    fn shelf(&self) -> MutexGuard<'_, Shelf> {
        // Nothing panics while it holds the lock; if it did, the shelf would be as good as before.
        self.shelf.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place for a job whose body is still to be read.
    pub(super) fn admit(&self) -> Result<OwnedSemaphorePermit, Refusal> {
        if *self.phase.borrow() != Phase::Open {
            return Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, ENDING).retry_after(MAX_RETRY_S));
        }
        Arc::clone(&self.slots).try_acquire_owned().map_err(|_| {
            let seconds = self.retry_s();
            Refusal::new(
                StatusCode::TOO_MANY_REQUESTS,
                format!(
                    "{} plan(s) are being made and {} more wait, as many as may: try again in {seconds} s",
                    self.limits.jobs, self.limits.queue
                ),
            )
            .retry_after(seconds)
        })
    }

    /// When a place is likely to be free: jobs take what the last one took.
    fn retry_s(&self) -> u64 {
        let of_one = self.last_ms.load(Ordering::Relaxed) / self.limits.jobs.max(1) as u64;
        of_one.div_ceil(1000).clamp(1, MAX_RETRY_S)
    }

    pub(super) fn find(&self, id: &str) -> Option<Arc<Job>> {
        self.shelf().jobs.get(id).cloned()
    }

    pub(super) fn counts(&self) -> Counts {
        let running = self.limits.jobs - self.running.available_permits();
        let open = self.limits.jobs + self.limits.queue - self.slots.available_permits();
        Counts { waiting: open.saturating_sub(running), running, kept: self.shelf().ended.len() }
    }

    /// Puts a job into the queue. `slot` is its place.
    pub(super) fn start<W: Work>(
        self: &Arc<Self>,
        work: Arc<W>,
        input: W::Job,
        warnings: Vec<String>,
        slot: OwnedSemaphorePermit,
    ) -> Result<Arc<Job>, Refusal> {
        let id = new_id().ok_or_else(Refusal::internal)?;
        let job = Arc::new(Job {
            status: watch::Sender::new(Status::waiting(id.clone(), warnings)),
            product: OnceLock::new(),
            stop: Stop::default(),
            fetched: AtomicBool::new(false),
        });
        self.shelf().jobs.insert(id.clone(), Arc::clone(&job));
        let (jobs, of_job) = (Arc::clone(self), Arc::clone(&job));
        tokio::spawn(async move {
            let start = Instant::now();
            jobs.attend(work, input, &of_job).await;
            drop(slot);
            jobs.shelve(id, &of_job, start.elapsed());
        });
        Ok(job)
    }

    /// Waits for the turn of a job and has it done.
    async fn attend<W: Work>(&self, work: Arc<W>, input: W::Job, job: &Arc<Job>) {
        let turn = tokio::select! {
            biased;
            () = self.reaches(Phase::Ending) => None,
            turn = Arc::clone(&self.running).acquire_owned() => turn.ok(),
        };
        let Some(turn) = turn else { return job.end(Err(ENDING.to_owned())) };
        let start = Instant::now();
        job.change(|status| status.state = State::Running);
        let reporter = Reporter(Arc::clone(job));
        let mut handle: JoinHandle<Result<Product, String>> =
            spawn_blocking(move || work.plan(input, &reporter));
        let cut_off = tokio::select! {
            ended = &mut handle => {
                job.end(ended.unwrap_or_else(|_| Err(INTERNAL.to_owned())));
                None
            }
            () = sleep(self.limits.job_time) => Some(format!(
                "took longer than the {} s that a plan may take here: ask for fewer attempts, or a smaller file",
                self.limits.job_time.as_secs_f64()
            )),
            () = self.reaches(Phase::Cut) => Some(ENDING.to_owned()),
        };
        if let Some(why) = cut_off {
            job.stop.ask();
            job.end(Err(why));
            // The cores are its own until it has heard.
            let _ = handle.await;
        }
        let took_ms = u64::try_from(start.elapsed().as_millis()).unwrap_or(u64::MAX);
        self.last_ms.store(took_ms, Ordering::Relaxed);
        drop(turn);
    }

    async fn reaches(&self, phase: Phase) {
        // The sender is this object's own and cannot be gone.
        let _ = self.phase.subscribe().wait_for(|now| *now >= phase).await;
    }

    /// Keeps a job that has ended, and drops the oldest beyond the bounds.
    fn shelve(&self, id: String, job: &Job, took: Duration) {
        let line = {
            let status = job.status.borrow();
            let outcome = match (status.grasps, &status.error) {
                (Some(grasps), _) => format!("done, {grasps} grasp(s)"),
                (None, error) => format!("failed: {}", error.as_deref().unwrap_or_default()),
            };
            format!("{id} {outcome}, after {:.2} s", took.as_secs_f64())
        };
        (self.log)(&line);
        let bytes = job.held_bytes();
        let mut shelf = self.shelf();
        shelf.ended.push_back((id, bytes));
        shelf.ended_bytes += bytes;
        while shelf.ended.len() > 1
            && (shelf.ended.len() > self.limits.kept || shelf.ended_bytes > self.limits.kept_bytes)
        {
            if let Some((oldest, bytes)) = shelf.ended.pop_front() {
                shelf.ended_bytes -= bytes;
                shelf.jobs.remove(&oldest);
            }
        }
    }

    /// Takes no more jobs, lets those that run end within the grace, and waits until their clients have them.
    pub(super) async fn end(&self) {
        let open: Vec<Arc<Job>> = {
            let shelf = self.shelf();
            shelf.jobs.values().filter(|job| !job.status.borrow().state.is_end()).cloned().collect()
        };
        self.phase.send_replace(Phase::Ending);
        let all_ended = async {
            for job in &open {
                let _ = job.status.subscribe().wait_for(|status| status.state.is_end()).await;
            }
        };
        if tokio::time::timeout(self.limits.grace, all_ended).await.is_err() {
            self.phase.send_replace(Phase::Cut);
        }
        let is_awaited = |job: &Arc<Job>| !job.fetched.load(Ordering::Relaxed) && job.product().is_some();
        let until = Instant::now() + FETCHING;
        while open.iter().any(is_awaited) && Instant::now() < until {
            sleep(Duration::from_millis(20)).await;
        }
    }
}

/// A name that nobody guesses, from the system's own randomness: whoever knows it may read the plan.
fn new_id() -> Option<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).ok()?;
    Some(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
