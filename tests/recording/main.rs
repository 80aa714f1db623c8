//! Tests of recordings: messages, writer, reader, damage, as one program: each file is a module.

#[path = "../support/generate_messages.rs"]
mod generate_messages;
#[path = "../support/python_reader.rs"]
mod python_reader;
#[path = "../support/recording.rs"]
mod recording;
#[path = "../support/skip.rs"]
mod skip;

mod damage;
mod difference;
mod messages;
mod other_writers;
mod python;
mod recorder;
mod roundtrip;
mod schema;
mod speed;
mod timeline;
mod topic;
