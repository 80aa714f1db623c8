//! Reader of an MCAP file that may be truncated anywhere: positions of its chunks, then one chunk at a time. Layout of the
//! records: the MCAP specification, "Records" (<https://mcap.dev/spec>).

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::records::{Record, op};

use super::chunk::{self, ChunkRecords, records_in};
use super::error::{ChunkError, RecordingError};
use super::lengths::{length, texts_fit};
use super::topic::Topic;

/// Opcode and length before each record.
const RECORD_HEAD: u64 = chunk::RECORD_HEAD as u64;
/// The footer record: head, two offsets and a checksum.
const FOOTER_BYTES: u64 = RECORD_HEAD + 8 + 8 + 4;
/// The record that ends the data: head and a checksum.
const DATA_END_BYTES: u64 = RECORD_HEAD + 4;
/// Largest accepted chunk, bytes: a larger length is damage, and must not decide how much memory is allocated.
const LARGEST_CHUNK: usize = 32 * 1024 * 1024;
/// Largest record of a chunk, bytes: with its head, and with the share that compression adds to random bytes.
const LARGEST_PACKED_CHUNK: u64 = LARGEST_CHUNK as u64 + 1024 * 1024;
/// Largest attachment, metadata record or index, bytes. The nominal size of a sparse file is no bound: it takes no room on the disk.
const LARGEST_READ: u64 = 256 * 1024 * 1024;

/// Position of a record in the file, bytes.
#[derive(Debug, Clone, Copy)]
pub struct RecordSpan {
    /// Offset of the record's head.
    pub offset: u64,
    /// Length of its body.
    pub bytes: u64,
}

/// Position and content of a chunk.
#[derive(Debug, Clone)]
pub struct Chunk {
    pub span: RecordSpan,
    /// Log time of its earliest message, ns UTC.
    pub start: u64,
    /// Log time of its latest message, ns UTC.
    pub end: u64,
    /// Channels of its messages; none if the index after the chunk is missing.
    pub channels: Option<Vec<u16>>,
}

/// An MCAP file with the positions of its records.
pub struct Container {
    file: File,
    path: PathBuf,
    /// Complete chunks, in the order of the file.
    pub chunks: Vec<Chunk>,
    pub attachments: Vec<RecordSpan>,
    pub metadata: Vec<RecordSpan>,
    /// Description of the missing end of the file; none for a finished file.
    pub cut: Option<String>,
    /// Whether the chunks were found by scanning: their times are those of their heads, which no checksum guards.
    pub scanned: bool,
    /// Offset of the record that ends the data; none of a file that was not finished.
    pub data_end: Option<u64>,
    /// Schemas and channels of the index; none without an index: then those of the chunks count.
    pub definitions: Vec<Record<'static>>,
    /// Offset of the first record that the scan has not passed.
    unscanned: u64,
    topics: Vec<Option<Topic>>,
}

impl Container {
    /// Opens a file; finds the chunks in its index if there is one, else by scanning from record to record.
    pub fn open(path: &Path) -> Result<Container, RecordingError> {
        let io = |doing| move |source| RecordingError::Io { path: path.into(), doing, source };
        // Opening a pipe would wait for its writer.
        let kind = std::fs::metadata(path).map_err(io("open the file"))?.file_type();
        if !kind.is_file() {
            return Err(RecordingError::NotAFile { path: path.into() });
        }
        let mut file = File::open(path).map_err(io("open the file"))?;
        let bytes = file.seek(SeekFrom::End(0)).map_err(io("read its length"))?;
        check_magic(&mut file, bytes, path)?;
        let mut container = Container {
            file,
            path: path.into(),
            chunks: Vec::new(),
            attachments: Vec::new(),
            metadata: Vec::new(),
            cut: None,
            scanned: false,
            data_end: None,
            definitions: Vec::new(),
            unscanned: mcap::MAGIC.len() as u64,
            topics: Vec::new(),
        };
        if !container.read_index(bytes).unwrap_or(false) {
            container.scan(bytes).map_err(|error| RecordingError::of_reading(path, error))?;
        }
        // The channels of a recording are in its first chunk.
        if let Some(chunk) = container.chunks.first().cloned()
            && let Err(source) = container.read_chunk(&chunk)
            && container.topics.is_empty()
        {
            return Err(RecordingError::Head { path: path.into(), source });
        }
        Ok(container)
    }

    /// Reads the file's index; false if it is missing or incomplete.
    fn read_index(&mut self, bytes: u64) -> Result<bool, McapError> {
        let magic = mcap::MAGIC.len() as u64;
        if bytes < 2 * magic + FOOTER_BYTES || self.read_at(bytes - magic, magic)? != mcap::MAGIC {
            return Ok(false);
        }
        let footer_at = bytes - magic - FOOTER_BYTES;
        let footer = self.read_at(footer_at, FOOTER_BYTES)?;
        // The opcode is checked first: the text of another record would be allocated by its length.
        if footer[0] != op::FOOTER {
            return Ok(false);
        }
        let Record::Footer(footer) = mcap::parse_record(op::FOOTER, &footer[RECORD_HEAD as usize..])? else {
            unreachable!("parsed by its opcode");
        };
        // Without a checksum nothing tells a damaged index: the scan finds the chunks themselves.
        if footer.summary_start == 0 || footer.summary_start > footer_at || footer.summary_crc == 0 {
            return Ok(false);
        }
        let index = self.read_at(footer.summary_start, bytes - footer.summary_start)?;
        // Before anything is parsed: a damaged length would decide how much memory is allocated. The checksum covers the footer
        // up to itself.
        if crc32fast::hash(&index[..index.len() - mcap::MAGIC.len() - 4]) != footer.summary_crc {
            return Ok(false);
        }
        let (mut chunks, mut attachments, mut metadata) = (Vec::new(), Vec::new(), Vec::new());
        let (mut schemas, mut channels) = (Vec::new(), Vec::new());
        for (opcode, body) in records_in(&index) {
            if !texts_fit(opcode, body) {
                return Ok(false);
            }
            match mcap::parse_record(opcode, body)? {
                schema @ Record::Schema { .. } => schemas.push(schema.into_owned()),
                Record::Channel(channel) => channels.push(channel),
                Record::ChunkIndex(index) => chunks.push(Chunk {
                    span: span(index.chunk_start_offset, index.chunk_length),
                    start: index.message_start_time,
                    end: index.message_end_time,
                    channels: Some(index.message_index_offsets.into_keys().collect()),
                }),
                Record::AttachmentIndex(index) => attachments.push(span(index.offset, index.length)),
                Record::MetadataIndex(index) => metadata.push(span(index.offset, index.length)),
                _ => {}
            }
        }
        // An index may leave out the chunks.
        if chunks.is_empty() {
            return Ok(false);
        }
        for channel in &channels {
            self.add_channel(channel.id, &channel.topic);
        }
        (self.chunks, self.attachments, self.metadata) = (chunks, attachments, metadata);
        self.definitions = schemas.into_iter().chain(channels.into_iter().map(Record::Channel)).collect();
        self.data_end = Some(footer.summary_start.saturating_sub(DATA_END_BYTES));
        Ok(true)
    }

    /// Returns whether the end of the data is missing, and not the index behind it alone.
    pub fn lacks_data_at_its_end(&self) -> bool {
        self.cut.is_some() && self.data_end.is_none()
    }

    /// Scans what was appended since the last scan; only of a file whose chunks were found by scanning.
    pub fn scan_appended(&mut self) -> Result<(), RecordingError> {
        let end = self.file.seek(SeekFrom::End(0)).map_err(McapError::Io);
        end.and_then(|bytes| self.scan(bytes)).map_err(|error| RecordingError::of_reading(&self.path, error))
    }

    /// Scans from record to record up to the first incomplete one, from where the last scan ended.
    fn scan(&mut self, bytes: u64) -> Result<(), McapError> {
        self.scanned = true;
        self.cut = None;
        let mut at = self.unscanned;
        while bytes - at >= RECORD_HEAD {
            let head = self.read_at(at, RECORD_HEAD)?;
            let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
            if length > bytes - at - RECORD_HEAD {
                break;
            }
            let span = RecordSpan { offset: at, bytes: length };
            match head[0] {
                op::CHUNK => {
                    // Start and end are the first two numbers of a chunk.
                    let times = self.read_at(at + RECORD_HEAD, 16.min(length))?;
                    let (Some(start), Some(end)) = (number(&times, 0), number(&times, 8)) else { break };
                    self.chunks.push(Chunk { span, start, end, channels: Some(Vec::new()) });
                }
                op::MESSAGE_INDEX => {
                    let id = self.read_at(at + RECORD_HEAD, 2.min(length))?;
                    let &[low, high] = id.as_slice() else { break };
                    // A chunk that was the last of an earlier scan has no list: part of its index was missing then.
                    if let Some(channels) = self.chunks.last_mut().and_then(|chunk| chunk.channels.as_mut()) {
                        channels.push(u16::from_le_bytes([low, high]));
                    }
                }
                op::ATTACHMENT => self.attachments.push(span),
                op::METADATA => self.metadata.push(span),
                op::DATA_END => {
                    self.unscanned = at;
                    match self.end_of_file(at, bytes)? {
                        Some(end) if end < bytes => {
                            let rest = bytes - end;
                            self.cut = Some(format!(
                                "its last {rest} of {bytes} bytes follow its end, as those of another file, and are left out"
                            ));
                            return Ok(());
                        }
                        Some(_) => {}
                        None => self.cut = Some("its index at the end is missing; all of its data is there".into()),
                    }
                    self.data_end = Some(at);
                    return Ok(());
                }
                0 => break, // no record: zeros left by a crashed file system
                _ => {}
            }
            at += RECORD_HEAD + length;
        }
        self.unscanned = at;
        if let Some(last) = self.chunks.last_mut() {
            last.channels = None;
        }
        self.cut = Some(match bytes - at {
            0 => "its end was not written: the program that recorded it did not finish the file; everything before is there".into(),
            rest => format!("it was cut off: its last {rest} of {bytes} bytes are an incomplete record"),
        });
        Ok(())
    }

    /// Returns the offset behind the end of the file that begins before `data_end`; none if its footer is missing. The index between
    /// them may be damaged if the file ends as it should.
    fn end_of_file(&mut self, data_end: u64, bytes: u64) -> Result<Option<u64>, McapError> {
        let magic = mcap::MAGIC.len() as u64;
        let mut at = data_end;
        while bytes - at >= FOOTER_BYTES + magic {
            let head = self.read_at(at, RECORD_HEAD)?;
            let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
            if head[0] == op::FOOTER && self.read_at(at + FOOTER_BYTES, magic)? == mcap::MAGIC {
                return Ok(Some(at + FOOTER_BYTES + magic));
            }
            if length > bytes - at - RECORD_HEAD {
                break;
            }
            at += RECORD_HEAD + length;
        }
        let is_ended = bytes - data_end >= DATA_END_BYTES + FOOTER_BYTES + magic;
        Ok((is_ended && self.read_at(bytes - magic, magic)? == mcap::MAGIC).then_some(bytes))
    }

    /// Returns the records of a chunk after verifying its checksum, and knows its channels from then on.
    ///
    /// # Errors
    /// When the checksum, a length, the number of messages or a channel is wrong; nothing of such a chunk is used.
    pub fn read_chunk(&mut self, chunk: &Chunk) -> Result<ChunkRecords, ChunkError> {
        if chunk.span.bytes > LARGEST_PACKED_CHUNK {
            return Err(McapError::ChunkTooLarge(chunk.span.bytes).into());
        }
        let body = self.read_record(chunk.span)?;
        let records = ChunkRecords::of(&body, LARGEST_CHUNK)?;
        for (opcode, body) in records.records().filter(|(opcode, _)| *opcode == op::CHANNEL) {
            if let Record::Channel(channel) = mcap::parse_record(opcode, body)? {
                self.add_channel(channel.id, &channel.topic);
            }
        }
        Ok(records)
    }

    /// Returns an attached file after verifying its checksum.
    pub fn read_attachment(&mut self, span: RecordSpan) -> Result<mcap::Attachment<'static>, McapError> {
        let body = self.read_record(span)?;
        // Log time, create time, name, media type, data, checksum: the lengths of the three in the middle must fit.
        let name = 16;
        let media_type = name + 4 + u64::from(length(&body, name));
        let data = media_type + 4 + u64::from(length(&body, media_type));
        if data + 8 + 4 > span.bytes {
            return Err(McapError::BadAttachmentLength { header: data + 8 + 4, available: span.bytes });
        }
        match mcap::parse_record(op::ATTACHMENT, &body)? {
            Record::Attachment { header, data, .. } => Ok(mcap::Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data: data.into_owned().into(),
            }),
            _ => unreachable!("parsed by its opcode"),
        }
    }

    /// Returns whether the checksum of all data, from the start of the file to the end of its data, is right; none without one.
    pub fn verify_data(&mut self) -> Result<Option<bool>, McapError> {
        let Some(data_end) = self.data_end else { return Ok(None) };
        let end = self.read_at(data_end, DATA_END_BYTES)?;
        let saved = u32::from_le_bytes(*end.last_chunk().expect("13 bytes"));
        if saved == 0 {
            return Ok(None);
        }
        let (mut hasher, mut at) = (crc32fast::Hasher::new(), 0);
        while at < data_end {
            let bytes = self.read_at(at, (1 << 20).min(data_end - at))?;
            hasher.update(&bytes);
            at += bytes.len() as u64;
        }
        Ok(Some(hasher.finalize() == saved))
    }

    /// Returns a metadata record; none of a damaged one.
    pub fn read_metadata(&mut self, span: RecordSpan) -> Result<Option<mcap::records::Metadata>, McapError> {
        let body = self.read_record(span)?;
        if !texts_fit(op::METADATA, &body) {
            return Ok(None);
        }
        match mcap::parse_record(op::METADATA, &body) {
            Ok(Record::Metadata(metadata)) => Ok(Some(metadata)),
            _ => Ok(None),
        }
    }

    pub fn read_record(&mut self, span: RecordSpan) -> Result<Vec<u8>, McapError> {
        self.read_at(span.offset + RECORD_HEAD, span.bytes)
    }

    /// Returns the topic of a channel; none for a foreign channel.
    pub fn topic(&self, channel: u16) -> Option<Topic> {
        self.topics.get(usize::from(channel)).copied().flatten()
    }

    fn add_channel(&mut self, id: u16, topic: &str) {
        let id = usize::from(id);
        if self.topics.len() <= id {
            self.topics.resize(id + 1, None);
        }
        self.topics[id] = Topic::from_name(topic);
    }

    fn read_at(&mut self, offset: u64, bytes: u64) -> Result<Vec<u8>, McapError> {
        // The length is checked against the file before memory is allocated.
        let end = self.file.seek(SeekFrom::End(0))?;
        if offset.checked_add(bytes).is_none_or(|last| last > end) {
            return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
        }
        if bytes > LARGEST_READ {
            let text =
                format!("a record of {bytes} bytes is longer than {LARGEST_READ}: damaged, or not written by quadfrog");
            return Err(io::Error::new(io::ErrorKind::InvalidData, text).into());
        }
        let mut buffer = vec![0; bytes as usize];
        self.file.seek(SeekFrom::Start(offset))?;
        self.file.read_exact(&mut buffer)?;
        Ok(buffer)
    }
}

/// Returns the position of a record from the index, whose length includes the head.
fn span(offset: u64, length: u64) -> RecordSpan {
    RecordSpan { offset, bytes: length.saturating_sub(RECORD_HEAD) }
}

fn number(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..at + 8).and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes)
}

fn check_magic(file: &mut File, bytes: u64, path: &Path) -> Result<(), RecordingError> {
    let mut magic = [0; 8];
    let length = magic.len().min(bytes as usize);
    let io = |source| RecordingError::Io { path: path.into(), doing: "read", source };
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    file.read_exact(&mut magic[..length]).map_err(io)?;
    let path = path.to_path_buf();
    match &magic[..length] {
        [] => Err(RecordingError::Empty { path }),
        found if !mcap::MAGIC.starts_with(found) => {
            let found = found.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ");
            Err(RecordingError::NotMcap { path, found })
        }
        found if found.len() < mcap::MAGIC.len() => Err(RecordingError::TooShort { path, bytes }),
        _ => Ok(()),
    }
}
