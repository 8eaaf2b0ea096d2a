//! Connections: so many and no more, none for longer than it has something to say, and each that ends gets its answer.

use std::convert::Infallible;
use std::future::poll_fn;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::response::IntoResponse;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use tokio_io_timeout::TimeoutStream;

use super::guard::Guard;
use super::refusal::error_body;

/// Connections beyond the bound that are being told so at the same time; others wait for them in the system's queue.
const REFUSED_AT_A_TIME: usize = 256;
/// How long the head of a request may take, and how long a connection may lie idle between two.
const HEAD_TIME: Duration = Duration::from_secs(30);
/// How long a client may read nothing of what it is sent.
const WRITE_TIME: Duration = Duration::from_secs(30);
/// How long, and how much, of what a client still sends is thrown away once it has its answer. Closing at once would
/// reset the connection, and the answer could be lost with it.
const LINGER_TIME: Duration = Duration::from_secs(2);
const LINGER_BYTES: u64 = 1 << 30;
/// Largest head of a request, bytes.
const MAX_HEAD_BYTES: usize = 64 << 10;
/// Pause after the system would accept no connection, as when there are no more file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// How long connections may take to end with the service.
const END_TIME: Duration = Duration::from_secs(5);

/// The right to serve a connection, or only to refuse it.
enum Place {
    Served(OwnedSemaphorePermit),
    Refused(OwnedSemaphorePermit),
}

/// Accepts and serves connections until `closing` says so, then lets those that are open end.
pub(super) async fn accept(
    listener: TcpListener,
    router: Router,
    guard: Guard,
    connections: usize,
    closing: watch::Receiver<bool>,
) {
    let served = Arc::new(Semaphore::new(connections));
    let refused = Arc::new(Semaphore::new(REFUSED_AT_A_TIME));
    let mut tasks = JoinSet::new();
    let mut end = closing.clone();
    loop {
        let place = async {
            tokio::select! {
                biased;
                Ok(place) = Arc::clone(&served).acquire_owned() => Some(Place::Served(place)),
                Ok(place) = Arc::clone(&refused).acquire_owned() => Some(Place::Refused(place)),
                else => None,
            }
        };
        let next = async {
            let place = place.await?;
            Some((listener.accept().await, place))
        };
        let next = tokio::select! {
            biased;
            _ = end.wait_for(|closed| *closed) => break,
            next = next => next,
        };
        match next {
            None => break,
            Some((Err(_), _)) => sleep(ACCEPT_PAUSE).await,
            Some((Ok((stream, _)), Place::Served(place))) => {
                let (router, closing) = (router.clone(), closing.clone());
                tasks.spawn(async move {
                    serve(stream, router, guard, closing).await;
                    drop(place);
                });
            }
            Some((Ok((stream, _)), Place::Refused(place))) => {
                tasks.spawn(async move {
                    refuse(stream).await;
                    drop(place);
                });
            }
        }
        while tasks.try_join_next().is_some() {}
    }
    drop(listener);
    let _ = timeout(END_TIME, async { while tasks.join_next().await.is_some() {} }).await;
}

async fn serve(stream: TcpStream, router: Router, guard: Guard, mut closing: watch::Receiver<bool>) {
    // Small answers go at once; without it they only go later.
    let _ = stream.set_nodelay(true);
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(WRITE_TIME));
    let router = TowerToHyperService::new(router);
    let service = service_fn(move |request: Request<Incoming>| {
        let checked = guard.check(request.headers());
        let router = router.clone();
        Box::pin(async move {
            match checked {
                Ok(()) => router.call(request).await,
                Err(refusal) => Ok::<_, Infallible>(refusal.into_response()),
            }
        })
    });
    let mut connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(MAX_HEAD_BYTES)
        .serve_connection(TokioIo::new(Box::pin(stream)), service);
    let mut is_told = false;
    let ended = loop {
        tokio::select! {
            ended = poll_fn(|context| connection.poll_without_shutdown(context)) => break ended,
            _ = closing.wait_for(|closed| *closed), if !is_told => {
                is_told = true;
                Pin::new(&mut connection).graceful_shutdown();
            }
        }
    };
    if ended.is_ok() {
        linger(connection.into_parts().io.into_inner()).await;
    }
}

/// Answers without having read the request.
async fn refuse(mut stream: TcpStream) {
    let body = error_body("more clients than this service takes at a time: try again in 1 s");
    let answer = format!(
        "HTTP/1.1 503 Service Unavailable\r\ncontent-type: application/json\r\nretry-after: 1\r\n\
         connection: close\r\ncontent-length: {}\r\n\r\n{body}",
        body.len()
    );
    if let Ok(Ok(())) = timeout(WRITE_TIME, stream.write_all(answer.as_bytes())).await {
        linger(stream).await;
    }
}

/// Ends our side of a connection and waits for the client to end its own.
async fn linger(mut stream: impl AsyncRead + AsyncWrite + Unpin) {
    let rest = async {
        stream.shutdown().await?;
        let mut thrown_away = [0; 8192];
        let mut left = LINGER_BYTES;
        loop {
            let count = stream.read(&mut thrown_away).await? as u64;
            if count == 0 || count > left {
                return std::io::Result::Ok(());
            }
            left -= count;
        }
    };
    let _ = timeout(LINGER_TIME, rest).await;
}
