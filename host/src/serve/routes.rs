//! What can be asked, and the answers.

use std::convert::Infallible;
use std::sync::Arc;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Path, Request, State as Shared};
use axum::response::sse::{Event, KeepAlive};
use axum::response::{IntoResponse, Response, Sse};
use axum::routing::{get, post};
use futures_util::stream;
use http_body_util::{BodyExt, LengthLimitError, Limited};
use hyper::body::Body as _;
use hyper::header::{CACHE_CONTROL, CONTENT_TYPE, HeaderValue, LOCATION};
use hyper::{HeaderMap, StatusCode};
use serde::Serialize;
use serde_json::json;
use tokio::task::spawn_blocking;
use tokio::time::timeout;

use super::jobs::{Job, Jobs};
use super::openapi;
use super::refusal::Refusal;
use super::{State, Status, Work};

/// What the answers need.
pub(super) struct Service<W> {
    work: Arc<W>,
    jobs: Arc<Jobs>,
    description: Bytes,
}

impl<W: Work> Service<W> {
    pub(super) fn new(work: W, jobs: Arc<Jobs>) -> Self {
        let description = openapi::document(&work.options(), &jobs.limits).to_string().into();
        Self { work: Arc::new(work), jobs, description }
    }

    fn job(&self, id: &str) -> Result<Arc<Job>, Refusal> {
        self.jobs.find(id).ok_or_else(|| {
            Refusal::new(
                StatusCode::NOT_FOUND,
                format!(
                    "there is no such plan, or not any more: the last {} are kept; post it again",
                    self.jobs.limits.kept
                ),
            )
        })
    }
}

type Serving<W> = Shared<Arc<Service<W>>>;

/// All routes. `openapi` describes each of them.
pub(super) fn router<W: Work>(service: Arc<Service<W>>) -> Router {
    Router::new()
        .route("/health", get(health::<W>))
        .route("/openapi.json", get(description::<W>))
        .route("/plans", post(submit::<W>))
        .route("/plans/{id}", get(status::<W>))
        .route("/plans/{id}/events", get(events::<W>))
        .route("/plans/{id}/plan.json", get(plan::<W>))
        .route("/plans/{id}/report", get(report::<W>))
        .fallback(async || Refusal::new(StatusCode::NOT_FOUND, "no such address: see GET /openapi.json"))
        .method_not_allowed_fallback(async || {
            Refusal::new(StatusCode::METHOD_NOT_ALLOWED, "not by this method: see GET /openapi.json")
        })
        .with_state(service)
}

fn json(status: StatusCode, value: &impl Serialize) -> Response {
    match serde_json::to_string(value) {
        Ok(text) => typed(status, "application/json", text + "\n"),
        Err(_) => Refusal::internal().into_response(),
    }
}

fn typed(status: StatusCode, media_type: &'static str, body: impl Into<Body>) -> Response {
    let mut response = Response::new(body.into());
    *response.status_mut() = status;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(media_type));
    // Plans are nobody's business but their client's.
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

async fn health<W: Work>(Shared(service): Serving<W>) -> Response {
    let counts = service.jobs.counts();
    let document = json!({
        "name": "prehend",
        "version": env!("CARGO_PKG_VERSION"),
        "waiting": counts.waiting,
        "running": counts.running,
        "kept": counts.kept,
    });
    json(StatusCode::OK, &document)
}

async fn description<W: Work>(Shared(service): Serving<W>) -> Response {
    typed(StatusCode::OK, "application/json", service.description.clone())
}

/// Takes a job in. What can be refused is refused before the body is read, so that a client that asks first
/// (`Expect: 100-continue`) need not send it.
async fn submit<W: Work>(Shared(service): Serving<W>, request: Request) -> Result<Response, Refusal> {
    let query = request.uri().query().unwrap_or_default();
    let options: Vec<(String, String)> = form_urlencoded::parse(query.as_bytes()).into_owned().collect();
    let asked = service.work.request(&options).map_err(Refusal::bad_request)?;
    let needs_body = service.work.needs_body(&asked);
    let is_empty = request.body().is_end_stream();
    if needs_body && is_empty {
        return Err(empty());
    }
    if !needs_body && !is_empty {
        return Err(Refusal::bad_request("object: a built-in object comes without a body"));
    }
    if needs_body {
        check_media_type(request.headers())?;
    }
    let limit = service.jobs.limits.body_bytes;
    if request.body().size_hint().lower() > limit as u64 {
        return Err(too_large(limit));
    }
    let slot = service.jobs.admit()?;
    let body = read_body(request.into_body(), &service.jobs).await?;
    if needs_body && body.is_empty() {
        return Err(empty());
    }
    let work = Arc::clone(&service.work);
    let read = spawn_blocking(move || work.read(asked, body)).await;
    let (job, warnings) = read
        .map_err(|_| Refusal::internal())?
        .map_err(|message| Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, message))?;
    let job = service.jobs.start(Arc::clone(&service.work), job, warnings, slot)?;
    let status = job.status.borrow().clone();
    let mut response = json(StatusCode::ACCEPTED, &status);
    if let Ok(location) = HeaderValue::from_str(&format!("/plans/{}", status.id)) {
        response.headers_mut().insert(LOCATION, location);
    }
    Ok(response)
}

async fn read_body(body: Body, jobs: &Jobs) -> Result<Vec<u8>, Refusal> {
    let limits = &jobs.limits;
    let whole = timeout(limits.body_time, Limited::new(body, limits.body_bytes).collect()).await;
    match whole {
        Ok(Ok(whole)) => Ok(whole.to_bytes().into()),
        Ok(Err(error)) if error.is::<LengthLimitError>() => Err(too_large(limits.body_bytes)),
        Ok(Err(_)) => Err(Refusal::bad_request("the body broke off: send it again")),
        Err(_) => Err(Refusal::new(
            StatusCode::REQUEST_TIMEOUT,
            format!(
                "the body was not here after {} s: send it faster, or less of it",
                limits.body_time.as_secs_f64()
            ),
        )),
    }
}

fn empty() -> Refusal {
    Refusal::bad_request(
        "the body is empty: send the mesh or cloud itself, or name a built-in object by ?object=NAME",
    )
}

fn too_large(limit_bytes: usize) -> Refusal {
    Refusal::new(
        StatusCode::PAYLOAD_TOO_LARGE,
        format!("larger than the {limit_bytes} bytes that this service takes: thin the cloud or mesh first"),
    )
}

/// The file itself is wanted, by whatever name: its own bytes say what it is.
fn check_media_type(headers: &HeaderMap) -> Result<(), Refusal> {
    let Some(given) = headers.get(CONTENT_TYPE) else { return Ok(()) };
    let text = given.to_str().unwrap_or_default();
    let essence = text.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    let is_file = ["application/octet-stream", "text/plain", "text/csv"].contains(&essence.as_str())
        || essence.starts_with("model/");
    if is_file {
        return Ok(());
    }
    Err(Refusal::new(
        StatusCode::UNSUPPORTED_MEDIA_TYPE,
        format!(
            "content type {text:?} is no mesh or cloud: send the file itself as application/octet-stream"
        ),
    ))
}

async fn status<W: Work>(Shared(service): Serving<W>, Path(id): Path<String>) -> Result<Response, Refusal> {
    let status = service.job(&id)?.status.borrow().clone();
    Ok(json(StatusCode::OK, &status))
}

/// The status at once, then whenever it changes; the stream ends with `done` or `failed`.
async fn events<W: Work>(Shared(service): Serving<W>, Path(id): Path<String>) -> Result<Response, Refusal> {
    let job = service.job(&id)?;
    let mut receiver = job.status.subscribe();
    receiver.mark_changed();
    // The job goes along, so that its sender lives as long as somebody listens.
    let steps = stream::unfold(Some((job, receiver)), async |following| {
        let (job, mut receiver) = following?;
        receiver.changed().await.ok()?;
        let status = receiver.borrow_and_update().clone();
        let next = (!status.state.is_end()).then_some((job, receiver));
        Some((Ok::<_, Infallible>(event(&status)), next))
    });
    Ok(Sse::new(steps).keep_alive(KeepAlive::default()).into_response())
}

fn event(status: &Status) -> Event {
    let name = match status.state {
        State::Waiting | State::Running => "progress",
        State::Done => "done",
        State::Failed => "failed",
    };
    // JSON has no line ends of its own. Strings and numbers always have JSON.
    Event::default().event(name).data(serde_json::to_string(status).unwrap_or_default())
}

/// The job, if it has a plan.
fn finished<W: Work>(service: &Service<W>, id: &str) -> Result<Arc<Job>, Refusal> {
    let job = service.job(id)?;
    let status = job.status.borrow().clone();
    match (status.state, status.error) {
        (State::Done, _) => Ok(job),
        (_, Some(error)) => {
            Err(Refusal::new(StatusCode::CONFLICT, format!("there is no plan, it failed: {error}")))
        }
        _ => Err(Refusal::new(
            StatusCode::CONFLICT,
            format!("the plan is not there yet: follow GET /plans/{id}/events"),
        )
        .retry_after(1)),
    }
}

async fn plan<W: Work>(Shared(service): Serving<W>, Path(id): Path<String>) -> Result<Response, Refusal> {
    let job = finished(&service, &id)?;
    let plan = job.product().ok_or_else(Refusal::internal)?.plan.clone();
    job.fetched();
    Ok(typed(StatusCode::OK, "application/json", plan))
}

async fn report<W: Work>(Shared(service): Serving<W>, Path(id): Path<String>) -> Result<Response, Refusal> {
    let job = finished(&service, &id)?;
    let page = job.product().and_then(|product| product.page.as_ref()).map(|(page, _)| Arc::clone(page));
    let Some(page) = page else {
        return Err(Refusal::new(
            StatusCode::NOT_FOUND,
            "there is no page of this plan: GET its plan.json, and see prehend view",
        ));
    };
    let drawn = spawn_blocking(move || page()).await.map_err(|_| Refusal::internal())?;
    let html = drawn.map_err(|message| Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, message))?;
    Ok(typed(StatusCode::OK, "text/html; charset=utf-8", html))
}
