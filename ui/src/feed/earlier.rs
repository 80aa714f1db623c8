//! The jump of the best trial of earlier sessions, for the charts of a study that is continued.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, sync_channel};

use quadfrog::recording::timeline::Timeline;
use quadfrog::telemetry::Tick;
use quadfrog::trial::Verdict;

use super::beside::ticks;
use crate::message::Msg;

/// Reads the accepted trial of the greatest value from the recordings of a study, on a thread of its own. The message comes once,
/// or never: recordings that cannot be read leave the charts to the trials of this session.
pub fn read_best_jump(files: Vec<PathBuf>) -> Receiver<Msg> {
    let (send, receive) = sync_channel(1);
    let read = move || {
        if let Some((trial, ticks)) = best_jump(&files) {
            // A console that has ended takes no message.
            let _ = send.send(Msg::EarlierJump { trial, ticks });
        }
    };
    // A system without another thread leaves the charts to this session, too.
    let _ = std::thread::Builder::new().name("earlier-jump".into()).spawn(read);
    receive
}

fn best_jump(files: &[PathBuf]) -> Option<(u32, Vec<Tick>)> {
    let mut recording = Timeline::open(files).ok()?;
    let rows = recording.rows();
    let accepted = rows.values().filter(|row| row.verdict == Some(Verdict::Accept));
    let values = accepted.filter_map(|row| Some((row.trial, row.value?)));
    // The earliest of equals.
    let (best, _) = values.reduce(|best, other| if other.1 > best.1 { other } else { best })?;
    let run = *recording.trials().iter().rev().find(|run| run.trial == best)?;
    Some((best, ticks(&mut recording, &run)))
}
