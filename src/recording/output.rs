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

use super::record::{Record, SessionInfo};
use super::schema;
use super::topic::Topic;

/// A chunk is closed once it holds this much, uncompressed: an eighth of a second of ticks. What a crash can take of
/// the data that the system already has is the one open chunk.
const CHUNK_BYTES: usize = 256 * 1024;

/// Where the bytes of a recording go: a file, or in a test something that fails.
pub trait Sink: Write + Send {
    /// Waits until everything written is on the disk.
    ///
    /// # Errors
    /// When the disk refuses.
    fn sync(&mut self) -> io::Result<()>;
}

impl Sink for File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_data()
    }
}

/// The container: topics to channels, messages to chunks.
pub struct Output {
    pub mcap: mcap::Writer<NoSeek<Disk>>,
    disk: Disk,
    buffer: Vec<u8>,
    open_bytes: usize,
}

impl Output {
    /// The header; every topic of this project is a channel from the start.
    pub fn new(sink: Box<dyn Sink>) -> Result<Output, McapError> {
        let disk = Disk(Arc::new(Mutex::new(Counted { sink: BufWriter::new(sink), bytes: 0 })));
        let mcap = WriteOptions::new()
            .profile("")
            .library(concat!("quadfrog ", env!("CARGO_PKG_VERSION")))
            .chunk_size(None) // closed by `close_full_chunk`, between ticks
            // Whole chunks or nothing: else a crash leaves a chunk of length 2^64 - 1, on which readers give up.
            .disable_seeking(true)
            .compression_level(1)
            .compression_threads(0)
            .create(NoSeek::new(disk.clone()))?;
        Ok(Output { mcap, disk, buffer: Vec::new(), open_bytes: 0 })
    }

    /// What survives a cut best: who and what, and the files that the session ran with.
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
            ("start_utc_ns", start_utc_ns.to_string()),
            ("clock", "log_time = start_utc_ns + monotonic ns since the engine started".to_string()),
        ];
        let metadata = fields.into_iter().map(|(key, value)| (key.to_string(), value)).collect();
        self.mcap.write_metadata(&Metadata { name: "session".into(), metadata })?;
        for (name, media_type, bytes) in attachments {
            self.mcap.attach(&mcap::Attachment {
                log_time: start_utc_ns,
                create_time: start_utc_ns,
                name: name.to_string(),
                media_type: media_type.to_string(),
                data: Cow::Borrowed(bytes),
            })?;
        }
        for (index, topic) in Topic::ALL.into_iter().enumerate() {
            let schema = topic.schema();
            let schema = self.mcap.add_schema(&schema.name, &schema.encoding, &schema.data)?;
            let channel = self.mcap.add_channel(schema, topic.name(), "protobuf", &BTreeMap::new())?;
            debug_assert_eq!(usize::from(channel), index + 1);
        }
        Ok(())
    }

    pub fn message(
        &mut self,
        topic: Topic,
        sequence: u32,
        log_time: u64,
        message: &impl Message,
    ) -> Result<(), McapError> {
        self.buffer.clear();
        message.encode(&mut self.buffer).expect("a Vec grows as far as it must");
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

    fn put(&mut self, topic: Topic, sequence: u32, log_time: u64) -> Result<(), McapError> {
        let channel_id = topic as u16 + 1;
        self.open_bytes += self.buffer.len();
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.mcap.write_to_known_channel(&header, &self.buffer)
    }

    /// The index, and all of it on the disk.
    pub fn finish(&mut self) -> Result<(), McapError> {
        self.mcap.finish()?;
        self.sync()
    }

    /// Waits until everything handed to the disk is on it.
    pub fn sync(&mut self) -> Result<(), McapError> {
        let mut disk = self.disk.lock();
        disk.sink.flush()?;
        Ok(disk.sink.get_mut().sync()?)
    }

    /// Bytes handed to the disk so far.
    pub fn bytes(&self) -> u64 {
        self.disk.lock().bytes
    }

    /// Closes the chunk if it is large enough. Not called between the messages of a tick.
    pub fn close_full_chunk(&mut self) -> Result<(), McapError> {
        if self.open_bytes < CHUNK_BYTES { Ok(()) } else { self.close_chunk() }
    }

    /// Closes the chunk and hands it to the operating system.
    pub fn close_chunk(&mut self) -> Result<(), McapError> {
        self.open_bytes = 0;
        self.mcap.flush()
    }
}

/// The sink, shared by the container, which writes, and the writer, which counts and syncs. Never contended.
#[derive(Clone)]
pub struct Disk(Arc<Mutex<Counted>>);

struct Counted {
    sink: BufWriter<Box<dyn Sink>>,
    bytes: u64,
}

impl Disk {
    fn lock(&self) -> MutexGuard<'_, Counted> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut counted = self.lock();
        let written = counted.sink.write(bytes)?;
        counted.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.lock().sink.flush()
    }
}

/// A name with something behind it.
pub fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}
