//! Foxglove's WebSocket protocol, version 1 (specification of github.com/foxglove/ws-protocol; foxglove 0.30, module `protocol::v1`): a
//! server without capabilities, which announces its channels and sends the messages of subscriptions.

use data_encoding::BASE64;
use serde::Deserialize;
use serde_json::json;

use crate::recording::topic::Topic;

/// Names of the protocol in the handshake. Both are the same for a server without capabilities.
pub const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// Code of a binary message with data of a subscription.
const MESSAGE_DATA: u8 = 1;

/// Returns the first message: name and capabilities; none of them lets a viewer send or change anything.
pub fn server_info() -> String {
    json!({
        "op": "serverInfo",
        "name": concat!("quadfrog ", env!("CARGO_PKG_VERSION")),
        "capabilities": [],
        "metadata": {},
    })
    .to_string()
}

/// Returns the second message: the channels, those of the recording.
pub fn advertise() -> String {
    let channel = |topic: &Topic| {
        let schema = topic.schema();
        json!({
            "id": channel_of(*topic),
            "topic": topic.name(),
            "encoding": "protobuf",
            "schemaName": schema.name,
            "schemaEncoding": schema.encoding,
            "schema": BASE64.encode(&schema.data),
        })
    };
    json!({ "op": "advertise", "channels": Topic::ALL.iter().map(channel).collect::<Vec<_>>() }).to_string()
}

/// Returns the answer to a request that is not one of a viewer.
pub fn refusal() -> String {
    json!({ "op": "status", "level": 1, "message": "view only: this server takes subscriptions and nothing else" })
        .to_string()
}

fn channel_of(topic: Topic) -> u32 {
    topic as u32 + 1
}

/// Returns a binary message: code, subscription, log time in ns, data; numbers little-endian.
pub fn message_data(subscription: u32, log_time: u64, data: &[u8]) -> Vec<u8> {
    let mut message = Vec::with_capacity(13 + data.len());
    message.push(MESSAGE_DATA);
    message.extend(subscription.to_le_bytes());
    message.extend(log_time.to_le_bytes());
    message.extend(data);
    message
}

/// A request of a viewer.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
pub enum ViewerRequest {
    /// Begins subscriptions.
    Subscribe { subscriptions: Vec<Subscription> },
    /// Ends subscriptions.
    #[serde(rename_all = "camelCase")]
    Unsubscribe { subscription_ids: Vec<u32> },
}

/// A subscription: its number, chosen by the viewer, and a channel.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Subscription {
    pub id: u32,
    pub channel_id: u32,
}

impl Subscription {
    /// Returns the topic; none for a channel that was not advertised.
    pub fn topic(&self) -> Option<Topic> {
        Topic::ALL.iter().copied().find(|topic| channel_of(*topic) == self.channel_id)
    }
}

/// Returns the request in a text; none for anything that a viewer cannot ask.
pub fn request(text: &str) -> Option<ViewerRequest> {
    serde_json::from_str(text).ok()
}
