//! Sessions on disk: the records (`record`), writing (`writer`, `recorder`), playing (`player`, `timeline`) and recovery after a crash
//! (`recover`).
//!
//! A recording is an MCAP file of protobuf messages; `recordings/README.md` lists its topics, `proto/frog.proto` its
//! fields. While it grows it is named `*.mcap.part`; only a finished one is named `*.mcap`.

mod chunk;
mod comments;
mod container;
mod coordinate_frames;
pub mod difference;
pub mod disk;
mod error;
mod event_index;
mod lengths;
pub mod live;
mod output;
pub mod player;
pub mod record;
pub mod recorder;
pub mod recover;

pub mod scene;
mod schema;
pub mod session_files;
pub mod session_writer;
mod tick;
pub mod timeline;
pub mod topic;
mod trial_table;
mod trials;
mod wire;
pub mod writer;

pub use error::{ChunkError, RecordingError};

/// The messages of `proto/frog.proto` as Rust types, made by `tests/recording/messages.rs`.
#[allow(missing_docs, clippy::all, reason = "generated; proto/frog.proto documents the fields")]
mod frog {
    include!("../../proto/generated/messages.rs");
}
