//! A recording as a container: topics to channels, messages to chunks, bytes to a disk.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions};
use prost::Message;

use super::event_index::EventIndexBuilder;
use super::live::LiveFeed;
use super::record::{Record, SessionInfo};
use super::topic::Topic;
use super::{comments, schema};
use crate::robot::description::RobotDescription;
use crate::trial::ParameterInfo;

/// Uncompressed bytes at which a chunk is closed: an eighth of a second of ticks. A crash loses at most the open chunk.
const CHUNK_BYTES: usize = 256 * 1024;

/// Level of zstd. Measured on jumps: level 3 makes files 8 % smaller than level 1, higher ones no smaller.
const COMPRESSION_LEVEL: u32 = 3;

/// Source of the messages of this program, attached to each recording.
const PROTO: &str = include_str!("../../proto/frog.proto");

/// Destination of a recording's bytes: a file, or a failing one in a test.
pub trait Sink: Write + Send {
    /// Waits until everything written is on the disk.
    fn sync(&mut self) -> io::Result<()>;
}

/// Discards everything.
impl Sink for io::Sink {
    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Sink for File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }
}

/// The container: topics to channels, messages to chunks.
pub struct Output {
    pub mcap: mcap::Writer<NoSeek<SharedSink>>,
    disk: SharedSink,
    /// Copies of the events, for the end of the file.
    pub events: EventIndexBuilder,
    /// Chunks closed so far.
    pub closed_chunks: u64,
    /// Viewers of the running session.
    pub live: Option<LiveFeed>,
    buffer: Vec<u8>,
    open_bytes: usize,
}

impl Output {
    pub fn new(sink: Box<dyn Sink>) -> Result<Output, McapError> {
        let disk =
            SharedSink(Arc::new(Mutex::new(BufferedSink { sink: BufWriter::new(CountedSink { sink, bytes: 0 }) })));
        let mcap = WriteOptions::new()
            .profile("")
            .library(concat!("quadfrog ", env!("CARGO_PKG_VERSION")))
            .chunk_size(None) // closed by `close_full_chunk`, between ticks
            // Chunks are written whole: with seeking, a crash leaves a chunk of length 2^64 - 1, which readers reject.
            .disable_seeking(true)
            // Of the levels with little work the one whose files are smallest.
            .compression_level(COMPRESSION_LEVEL)
            .compression_threads(0)
            .create(NoSeek::new(disk.clone()))?;
        Ok(Output {
            mcap,
            disk,
            events: EventIndexBuilder::default(),
            closed_chunks: 0,
            live: None,
            buffer: Vec::new(),
            open_bytes: 0,
        })
    }

    /// Writes metadata, attachments and all channels, at the beginning, where they survive a truncation.
    pub fn head(
        &mut self,
        session: &SessionInfo,
        start_utc_ns: u64,
        attachments: &[(&str, &str, &[u8])],
    ) -> Result<(), McapError> {
        let fields = [
            ("tool", "quadfrog".to_string()),
            ("version", session.version.clone()),
            ("backend", session.backend_name().to_string()),
            ("robot", session.robot.clone()),
            ("task", session.task_name().to_string()),
            ("sampler", session.sampler_name().to_string()),
            ("seed", session.seed.to_string()),
            ("budget", session.budget.to_string()),
            ("started", session.started.clone()),
            ("commit", session.commit.clone()),
            ("host", session.host.clone()),
            ("operator", session.operator.clone()),
            ("parameters", bounds(&session.parameters)),
            ("start_utc_ns", start_utc_ns.to_string()),
            ("clock", "log_time = start_utc_ns + monotonic ns since the engine started".to_string()),
        ];
        let metadata = fields.into_iter().map(|(key, value)| (key.to_string(), value)).collect();
        self.mcap.write_metadata(&Metadata { name: "session".into(), metadata })?;
        for (name, media_type, bytes) in attachments {
            self.attach(name, media_type, bytes, start_utc_ns)?;
        }
        self.attach("frog.proto", "text/plain", PROTO.as_bytes(), start_utc_ns)?;
        for (index, topic) in Topic::ALL.iter().enumerate() {
            let schema = topic.schema();
            let comments = comments::of(&schema.name);
            let schema = self.mcap.add_schema(&schema.name, &schema.encoding, &schema.data)?;
            let channel = self.mcap.add_channel(schema, topic.name(), "protobuf", &comments)?;
            debug_assert_eq!(usize::from(channel), index + 1);
        }
        Ok(())
    }

    /// Writes the URDF with primitive shapes, and the metadata that names it.
    pub fn robot(&mut self, robot: &RobotDescription, start_utc_ns: u64) -> Result<(), McapError> {
        let mut metadata = BTreeMap::from([
            ("name".to_string(), robot.name.clone()),
            ("root_link".to_string(), robot.trunk.name.clone()),
            ("joints".to_string(), robot.joint_names.join(" ")),
        ]);
        if let Some((name, _)) = robot.urdf() {
            metadata.insert("urdf".to_string(), name.to_string());
        }
        if let Some(text) = robot.urdf_with_visual_shapes() {
            let name = format!("{}.visual.urdf", robot.name);
            self.attach(&name, "application/xml", text.as_bytes(), start_utc_ns)?;
            metadata.insert("urdf_with_shapes".to_string(), name);
        }
        self.mcap.write_metadata(&Metadata { name: "robot".into(), metadata })
    }

    pub fn attach(&mut self, name: &str, media_type: &str, bytes: &[u8], time: u64) -> Result<(), McapError> {
        // An attachment stands between chunks.
        self.close_chunk()?;
        self.mcap.attach(&mcap::Attachment {
            log_time: time,
            create_time: time,
            name: name.to_string(),
            media_type: media_type.to_string(),
            data: Cow::Borrowed(bytes),
        })
    }

    pub fn message(
        &mut self,
        topic: Topic,
        sequence: u32,
        log_time: u64,
        message: &impl Message,
    ) -> Result<(), McapError> {
        self.buffer.clear();
        message.encode(&mut self.buffer).expect("a Vec grows as needed");
        self.put(topic, sequence, log_time)
    }

    pub fn record(
        &mut self,
        record: &Record,
        start_utc_ns: u64,
        sequence: u32,
        log_time: u64,
    ) -> Result<(), McapError> {
        let topic = schema::encode(record, start_utc_ns, log_time, &mut self.buffer);
        self.put(topic, sequence, log_time)
    }

    /// Sends every message from here on to the viewers, too, and the session's own now.
    pub fn show_live(&mut self, live: LiveFeed, session: &SessionInfo, start_utc_ns: u64, log_time: u64) {
        let topic = schema::encode(&Record::Session(session.clone()), start_utc_ns, log_time, &mut self.buffer);
        live.send(topic, log_time, &self.buffer);
        self.live = Some(live);
    }

    fn put(&mut self, topic: Topic, sequence: u32, log_time: u64) -> Result<(), McapError> {
        let channel_id = topic as u16 + 1;
        self.open_bytes += self.buffer.len();
        self.events.add(topic, channel_id, log_time, &self.buffer);
        if let Some(live) = &self.live {
            live.send(topic, log_time, &self.buffer);
        }
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.mcap.write_to_known_channel(&header, &self.buffer)
    }

    /// Writes the copies of the events and the index, and waits until everything is on the disk.
    pub fn finish(&mut self) -> Result<(), McapError> {
        self.close_chunk()?;
        let offset = self.bytes();
        self.mcap.attach(&self.events.attachment(offset))?;
        self.mcap.finish()?;
        self.sync()
    }

    /// Waits until everything passed to the disk is on it.
    pub fn sync(&mut self) -> Result<(), McapError> {
        let mut disk = self.disk.lock();
        disk.sink.flush()?;
        Ok(disk.sink.get_mut().sink.sync()?)
    }

    pub fn bytes(&self) -> u64 {
        self.disk.lock().sink.get_ref().bytes
    }

    /// Closes the chunk if it is large enough. Not called between the messages of a tick.
    pub fn close_full_chunk(&mut self) -> Result<(), McapError> {
        if self.open_bytes < CHUNK_BYTES { Ok(()) } else { self.close_chunk() }
    }

    /// Closes the chunk and passes it to the operating system.
    pub fn close_chunk(&mut self) -> Result<(), McapError> {
        self.open_bytes = 0;
        self.closed_chunks += 1;
        self.mcap.flush()
    }
}

/// The sink, shared by the MCAP writer, which writes, and [`Output`], which counts and syncs. Both are on one thread.
#[derive(Clone)]
pub struct SharedSink(Arc<Mutex<BufferedSink>>);

struct BufferedSink {
    sink: BufWriter<CountedSink>,
}

/// Counts the bytes that the sink has taken: those in the buffer before it are not on a disk that is full.
struct CountedSink {
    sink: Box<dyn Sink>,
    bytes: u64,
}

impl Write for CountedSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.sink.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

impl SharedSink {
    fn lock(&self) -> MutexGuard<'_, BufferedSink> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for SharedSink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.lock().sink.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.lock().sink.flush()
    }
}

/// Returns the bounds of parameters as text: `f0 0.75..1.75 Hz, Fx 0..150 N`.
fn bounds(parameters: &[ParameterInfo]) -> String {
    let text = |p: &ParameterInfo| format!("{} {}..{} {}", p.name, p.low, p.high, p.unit);
    parameters.iter().map(text).collect::<Vec<_>>().join(", ")
}

pub fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}
