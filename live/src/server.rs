//! One browser's page: HTTP and WebSocket at 127.0.0.1, with a token in the address.
//!
//! The server refuses other hosts in the request (a name that somebody points to this computer), other origins, and requests without the
//! token. Messages are short; a message that is too long ends the connection, and one that is not understood changes nothing at the
//! drive.

use std::collections::HashMap;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Query, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN, REFERRER_POLICY,
};
use axum::http::{HeaderMap, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::serve::Listener;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::service::TowerToHyperService;
use serde::Deserialize;
use serde_json::json;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;
use tokio::time::{interval, timeout};

use crate::drive;
use crate::shared::Shared;

/// Time from one message to the page to the next.
const TICK: Duration = Duration::from_millis(40);
/// Time after which a page that accepts no message is disconnected.
const SLOW: Duration = Duration::from_secs(2);
/// Longest time for the head of a request, also for the next request of a connection.
pub const HEAD: Duration = Duration::from_secs(5);
/// Most connections at a time, apart from the one WebSocket; further ones wait.
const MOST_CONNECTIONS: usize = 256;
/// Longest message of the page, bytes.
pub const LONGEST: usize = 8192;

/// Access to the page.
struct Access {
    shared: Arc<Shared>,
    address: SocketAddr,
    token: String,
}

/// A new token: 128 random bits.
///
/// # Errors
/// The system has no random numbers.
pub fn token() -> Result<String, getrandom::Error> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Serves the page until the program ends.
///
/// # Errors
/// Errors of the listener.
pub async fn serve(
    mut listener: TcpListener,
    token: String,
    shared: Arc<Shared>,
) -> std::io::Result<()> {
    let access = Arc::new(Access { shared, address: listener.local_addr()?, token });
    let router = Router::new()
        .route("/", get(page))
        .route("/ws", get(upgrade))
        .layer(from_fn_with_state(access.clone(), guard))
        .with_state(access);
    let connections = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let permit = connections.clone().acquire_owned().await.map_err(std::io::Error::other)?;
        let (stream, _) = Listener::accept(&mut listener).await;
        let service = TowerToHyperService::new(router.clone());
        tokio::spawn(async move {
            let mut http = Builder::new(TokioExecutor::new()).http1_only();
            http.http1().timer(TokioTimer::new()).header_read_timeout(HEAD);
            // A client that disconnects, or is too slow, is no error of this program.
            let _ = http.serve_connection_with_upgrades(TokioIo::new(stream), service).await;
            drop(permit);
        });
    }
}

/// Lets requests pass that come from this page.
async fn guard(
    State(access): State<Arc<Access>>,
    Query(query): Query<HashMap<String, String>>,
    headers: HeaderMap,
    request: Request,
    next: Next,
) -> Response {
    let port = access.address.port();
    let names = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let is = |name: axum::http::HeaderName, allowed: &dyn Fn(&str) -> bool| {
        headers.get(name).and_then(|value| value.to_str().ok()).is_some_and(allowed)
    };
    let own_host = is(HOST, &|host| names.iter().any(|name| name == host));
    let own_origin = is(ORIGIN, &|origin| {
        origin.strip_prefix("http://").is_some_and(|host| names.iter().any(|name| name == host))
    });
    // A browser sends the origin with every WebSocket, but not with a page that the user opens.
    let origin_is_due = request.uri().path() == "/ws" || headers.contains_key(ORIGIN);
    let refuse = |why: &'static str| (StatusCode::FORBIDDEN, why).into_response();
    if query.get("token") != Some(&access.token) {
        refuse("the address needs the token that `cargo live` prints\n")
    } else if !own_host || (origin_is_due && !own_origin) {
        refuse("only the page that `cargo live` serves may connect\n")
    } else {
        next.run(request).await
    }
}

/// The whole page in one document, so that it loads nothing else.
async fn page() -> Response {
    let style = |text: &str| format!("<style>{text}</style>");
    let script = |text: &str| format!("<script>{text}</script>");
    let mut page = include_str!("../page/index.html").to_owned();
    for (name, text) in [
        ("uplot/uPlot.min.css", style(include_str!("../page/uplot/uPlot.min.css"))),
        ("style.css", style(include_str!("../page/style.css"))),
        ("uplot/uPlot.iife.min.js", script(include_str!("../page/uplot/uPlot.iife.min.js"))),
        ("app.js", script(include_str!("../page/app.js"))),
        ("panels.js", script(include_str!("../page/panels.js"))),
    ] {
        page = page.replace(&format!("<link rel=\"stylesheet\" href=\"{name}\">"), &text);
        page = page.replace(&format!("<script src=\"{name}\"></script>"), &text);
    }
    let policy = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; \
                  connect-src 'self'; img-src data:; frame-ancestors 'none'";
    let headers = [
        (CONTENT_TYPE, "text/html; charset=utf-8"),
        (CACHE_CONTROL, "no-store"),
        (REFERRER_POLICY, "no-referrer"),
        (CONTENT_SECURITY_POLICY, policy),
    ];
    (headers, page).into_response()
}

async fn upgrade(State(access): State<Arc<Access>>, socket: WebSocketUpgrade) -> Response {
    let shared = access.shared.clone();
    socket
        .max_message_size(LONGEST)
        .max_frame_size(LONGEST)
        .on_upgrade(move |socket| converse(socket, shared))
}

/// A message of the page.
#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Said {
    /// The page has shown the last tick.
    Ack,
    /// Stop the drive, ahead of all waiting messages.
    Stop,
    /// A line for the console, with a number for the answer.
    Ask(u64, String),
}

async fn converse(mut socket: WebSocket, shared: Arc<Shared>) {
    let number = shared.page_comes();
    let mut tick = interval(TICK);
    loop {
        tokio::select! {
            _ = tick.tick() => {
                if !shared.is_present(number) {
                    let text = json!([{ "gone": "another page took over; reload to take it back" }]);
                    let _ = timeout(SLOW, socket.send(Message::text(text.to_string()))).await;
                    break;
                }
                let (texts, frames) = shared.take();
                // Texts come first, because the answer to a new stream describes its frames.
                let messages = [
                    Some(Message::text(json!(texts).to_string())),
                    (!frames.is_empty()).then(|| Message::binary(frames)),
                ];
                let mut sent = true;
                for message in messages.into_iter().flatten() {
                    sent &= matches!(timeout(SLOW, socket.send(message)).await, Ok(Ok(())));
                }
                if !sent {
                    break;
                }
            }
            message = socket.recv() => match message {
                Some(Ok(Message::Text(text))) => take(&shared, number, &text),
                Some(Ok(Message::Binary(_))) => take(&shared, number, "bytes"),
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                Some(Ok(Message::Close(_)) | Err(_)) | None => break,
            },
        }
    }
    shared.page_goes(number);
}

/// Carries out a message of the page.
fn take(shared: &Shared, number: u64, text: &str) {
    if !shared.is_present(number) {
        return;
    }
    match serde_json::from_str(text) {
        Ok(Said::Ack) => shared.page_answers(number),
        Ok(Said::Stop) => shared.stop("by the page"),
        Ok(Said::Ask(id, line)) => match drive::checked(&line) {
            Ok(line) => shared.ask(id, line),
            Err(why) => shared.tell(json!({ "id": id, "error": why })),
        },
        Err(why) => shared.tell(json!({ "refused": format!("not understood: {why}") })),
    }
}
