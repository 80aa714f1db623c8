//! The thread of one viewer: handshake, requests, messages.

use std::io::{self, ErrorKind};
use std::net::TcpStream;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::header::SEC_WEBSOCKET_PROTOCOL;
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket, accept_hdr_with_config};

use super::audience::Shared;
use super::protocol::{SUBPROTOCOLS, ViewerRequest, advertise, refusal, request, server_info};

/// Longest pause of a viewer in the handshake.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// Longest wait for a request between two looks at the queue.
const REQUEST_WAIT: Duration = Duration::from_millis(10);
/// Longest wait for a viewer that takes nothing; then it is disconnected.
const LONGEST_WRITE: Duration = Duration::from_secs(5);
/// Longest request, bytes: subscriptions to all topics take some 2000.
const LONGEST_REQUEST: usize = 64 * 1024;

/// Serves a viewer until it leaves, takes nothing, breaks the protocol, or the server ends.
pub fn serve(stream: TcpStream, shared: &Shared) -> Result<(), Box<Error>> {
    stream.set_nonblocking(false).map_err(boxed)?;
    stream.set_nodelay(true).map_err(boxed)?;
    stream.set_read_timeout(Some(HANDSHAKE)).map_err(boxed)?;
    stream.set_write_timeout(Some(LONGEST_WRITE)).map_err(boxed)?;
    let config = WebSocketConfig::default()
        .max_message_size(Some(LONGEST_REQUEST))
        .max_frame_size(Some(LONGEST_REQUEST))
        .read_buffer_size(4096);
    let Ok(mut socket) = accept_hdr_with_config(stream, negotiate, Some(config)) else { return Ok(()) };
    socket.get_ref().set_read_timeout(Some(REQUEST_WAIT)).map_err(boxed)?;
    socket.send(Message::text(server_info()))?;
    socket.send(Message::text(advertise()))?;
    let (number, messages) = shared.join();
    let ended = exchange(&mut socket, shared, number, &messages);
    shared.remove(number);
    ended
}

/// Agrees on the protocol; refuses a viewer that offers another one, for example a page that is no viewer at all.
#[allow(clippy::result_large_err, reason = "the type of the library's callback")]
fn negotiate(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let offered = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL);
    let offered = offered.iter().filter_map(|value| value.to_str().ok()).flat_map(|value| value.split(','));
    let offered: Vec<&str> = offered.map(str::trim).collect();
    match SUBPROTOCOLS.into_iter().find(|known| offered.contains(known)) {
        Some(known) => {
            response.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, HeaderValue::from_static(known));
            Ok(response)
        }
        None => {
            let mut refused = ErrorResponse::new(Some(format!("subprotocol: {}\n", SUBPROTOCOLS.join(" or "))));
            *refused.status_mut() = StatusCode::BAD_REQUEST;
            Err(refused)
        }
    }
}

fn exchange(
    socket: &mut WebSocket<TcpStream>,
    shared: &Shared,
    number: u64,
    messages: &Receiver<Vec<u8>>,
) -> Result<(), Box<Error>> {
    while !shared.closing.load(Ordering::Relaxed) {
        for message in messages.try_iter() {
            socket.write(Message::binary(message))?;
        }
        socket.flush()?;
        match socket.read() {
            Ok(Message::Text(text)) => answer(socket, shared, number, &text)?,
            Ok(Message::Binary(_)) => socket.send(Message::text(refusal()))?,
            Ok(Message::Close(_)) => return Ok(()),
            Ok(_) => {}
            Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error.into()),
        }
    }
    socket.close(None)?;
    Ok(socket.flush()?)
}

fn answer(socket: &mut WebSocket<TcpStream>, shared: &Shared, number: u64, text: &str) -> Result<(), Box<Error>> {
    match request(text) {
        Some(ViewerRequest::Subscribe { subscriptions }) => {
            for wanted in subscriptions {
                if let Some(topic) = wanted.topic() {
                    shared.subscribe(number, wanted.id, topic);
                }
            }
            Ok(())
        }
        Some(ViewerRequest::Unsubscribe { subscription_ids }) => {
            subscription_ids.into_iter().for_each(|id| shared.unsubscribe(number, id));
            Ok(())
        }
        None => Ok(socket.send(Message::text(refusal()))?),
    }
}

fn boxed(error: io::Error) -> Box<Error> {
    Error::Io(error).into()
}
