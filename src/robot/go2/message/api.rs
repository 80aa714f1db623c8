//! Requests to the robot's services and their responses: topics `rt/api/NAME/request` and `rt/api/NAME/response`, types
//! `unitree_api::msg::dds_::Request_` and `Response_`.

use super::cdr::{CdrReader, CdrWriter};
use super::rejection::MessageRejection;

/// Bytes of the longest part of fixed length in either message, with all alignment.
const FIXED: usize = 56;

/// The service `motion_switcher`, which releases the robot's own controller.
pub mod motion_switcher {
    use super::RequestMessage;

    /// Name of the service.
    pub const SERVICE: &str = "motion_switcher";
    /// Asks for the name of the active controller; an empty name means released.
    pub const CHECK_MODE: i64 = 1001;
    /// Starts a controller by its name.
    pub const SELECT_MODE: i64 = 1002;
    /// Releases the active controller: the legs lose their support.
    pub const RELEASE_MODE: i64 = 1003;

    /// Returns the request for the active controller's name.
    pub fn check_mode(id: i64) -> RequestMessage {
        RequestMessage::new(id, CHECK_MODE, "{}".to_owned())
    }

    /// Returns the request to start the controller `name`.
    pub fn select_mode(id: i64, name: &str) -> RequestMessage {
        let name = serde_json::Value::from(name);
        RequestMessage::new(id, SELECT_MODE, format!("{{\"name\": {name}}}"))
    }

    /// Returns the request to release the active controller.
    pub fn release_mode(id: i64) -> RequestMessage {
        RequestMessage::new(id, RELEASE_MODE, "{}".to_owned())
    }
}

/// The service `sport`, the robot's own controller.
pub mod sport {
    use super::RequestMessage;

    /// Name of the service.
    pub const SERVICE: &str = "sport";
    /// Damps every joint.
    pub const DAMP: i64 = 1001;
    /// Lies down.
    pub const STAND_DOWN: i64 = 1005;

    /// Returns the request `api` without a parameter.
    pub fn request(id: i64, api: i64) -> RequestMessage {
        RequestMessage::new(id, api, "{}".to_owned())
    }
}

/// A request to a service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RequestMessage {
    /// Identity, unique among all requests; the response has the same.
    pub id: i64,
    /// Number of the function.
    pub api: i64,
    /// Lease; zero without one.
    pub lease: i64,
    /// Priority; zero from the SDK.
    pub priority: i32,
    /// Whether no response is wanted.
    pub no_reply: bool,
    /// Parameter, JSON.
    pub parameter: String,
    /// Binary parameter.
    pub binary: Vec<u8>,
}

impl RequestMessage {
    fn new(id: i64, api: i64, parameter: String) -> RequestMessage {
        RequestMessage { id, api, lease: 0, priority: 0, no_reply: false, parameter, binary: Vec::new() }
    }

    /// Encodes the payload.
    pub fn encode(&self) -> Vec<u8> {
        let mut payload = vec![0; FIXED + self.parameter.len() + self.binary.len()];
        let mut writer = CdrWriter::new(&mut payload);
        writer.number(self.id.to_le_bytes());
        writer.number(self.api.to_le_bytes());
        writer.number(self.lease.to_le_bytes());
        writer.number(self.priority.to_le_bytes());
        writer.bytes(&[u8::from(self.no_reply)]);
        writer.sequence(self.parameter.as_bytes(), &[0]);
        writer.sequence(&self.binary, &[]);
        let length = writer.length();
        payload.truncate(length);
        payload
    }

    /// Decodes a payload, for an emulator.
    ///
    /// # Errors
    /// The payload is too short, its text is none, or a truth value is neither 0 nor 1.
    pub fn decode(payload: &[u8]) -> Result<RequestMessage, MessageRejection> {
        let mut reader = CdrReader::new(payload);
        Ok(RequestMessage {
            id: reader.i64()?,
            api: reader.i64()?,
            lease: reader.i64()?,
            priority: reader.i32()?,
            no_reply: reader.truth("noreply")?,
            parameter: reader.text("parameter")?.to_owned(),
            binary: reader.sequence()?.to_vec(),
        })
    }
}

/// The response of a service. Responses to other programs' requests arrive on the same topic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ResponseMessage {
    /// Identity of the request.
    pub id: i64,
    /// Number of the function.
    pub api: i64,
    /// Zero for success; 7002 motion switcher busy, 7004 unknown name, 7008 release failed, 5202 service protected.
    pub code: i32,
    /// Result, JSON.
    pub data: String,
    /// Binary result.
    pub binary: Vec<u8>,
}

impl ResponseMessage {
    /// Encodes the payload, for an emulator.
    pub fn encode(&self) -> Vec<u8> {
        let mut payload = vec![0; FIXED + self.data.len() + self.binary.len()];
        let mut writer = CdrWriter::new(&mut payload);
        writer.number(self.id.to_le_bytes());
        writer.number(self.api.to_le_bytes());
        writer.number(self.code.to_le_bytes());
        writer.sequence(self.data.as_bytes(), &[0]);
        writer.sequence(&self.binary, &[]);
        let length = writer.length();
        payload.truncate(length);
        payload
    }

    /// Decodes a payload.
    ///
    /// # Errors
    /// The payload is too short, or its text is none.
    pub fn decode(payload: &[u8]) -> Result<ResponseMessage, MessageRejection> {
        let mut reader = CdrReader::new(payload);
        Ok(ResponseMessage {
            id: reader.i64()?,
            api: reader.i64()?,
            code: reader.i32()?,
            data: reader.text("data")?.to_owned(),
            binary: reader.sequence()?.to_vec(),
        })
    }

    /// Returns the name of the active controller from the response to [`motion_switcher::CHECK_MODE`]: empty if the
    /// controller is released, none if the data are no such answer.
    pub fn active_mode(&self) -> Option<String> {
        let data: serde_json::Value = serde_json::from_str(&self.data).ok()?;
        let answered = self.code == 0 && self.api == motion_switcher::CHECK_MODE;
        data.get("name")?.as_str().filter(|_| answered).map(str::to_owned)
    }
}
