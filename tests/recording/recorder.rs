//! The recorder thread: nothing is lost, trials are delivered, a failing disk ends only the recording.

use crate::recording as support;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, mpsc};

use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::recording::recorder::{CollectedTicks, FAULT_TICKS, Recorder, RecorderHandle, TrialTicks};
use quadfrog::recording::session_files::recordings_in;
use quadfrog::recording::session_writer::{RotationLimits, SessionWriter};
use quadfrog::recording::timeline::Timeline;
use quadfrog::recording::writer::{Sink, Writer};
use quadfrog::telemetry::{Counters, Mode, Tick};
use support::*;

/// Runs a recorder on live ticks and records up to its end.
fn record(writer: Option<Writer>, ticks: &[Tick], records: &[Stamped]) -> (RecorderHandle, Vec<TrialTicks>) {
    let (mut ring, consumer) = rtrb::RingBuffer::new(64);
    let (sender, receiver) = mpsc::channel();
    let (trial_sender, trials) = mpsc::channel();
    let handle = Recorder::spawn(consumer, receiver, writer.map(Into::into), trial_sender).unwrap();
    let mut records = records.iter().peekable();
    for tick in ticks {
        while let Some(stamped) = records.next_if(|stamped| stamped.time_ns <= tick.time_ns) {
            sender.send(stamped.clone()).unwrap();
        }
        while ring.is_full() {
            std::thread::yield_now();
        }
        ring.push(*tick).unwrap();
    }
    drop((ring, sender));
    // The channel ends when the thread does.
    let trials = trials.into_iter().filter_map(|handed| match handed {
        CollectedTicks::Trial(trial) => Some(trial),
        CollectedTicks::Fault(_) => None,
    });
    (handle, trials.collect())
}

fn trials_of(ticks: &[Tick]) -> Vec<TrialTicks> {
    let runs = ticks.chunk_by(|a, b| a.trial == b.trial);
    runs.filter_map(|run| run[0].trial.map(|trial| TrialTicks { trial, ticks: run.to_vec() })).collect()
}

#[test]
fn a_session_is_recorded_in_whole_and_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (mut ticks, records) = study(6);
    // A trial that follows another without a pause, and one that the end cuts off.
    ticks[2000..2500].iter_mut().for_each(|tick| tick.trial = Some(40));
    ticks[5990..].iter_mut().for_each(|tick| tick.trial = Some(41));
    let writer = Writer::create(&path, &session(), START_UTC_NS, &[]).unwrap();
    let (handle, trials) = record(Some(writer), &ticks, &records);
    let status = handle.join();
    assert_eq!((status.ticks, status.error.clone(), status.finished), (6000, None, true), "{status:?}");
    assert!(status.bytes > 0 && status.bytes <= std::fs::metadata(&path).unwrap().len());
    assert_same(&play(&path), &in_order(&ticks, &records));
    assert_eq!(trials.iter().map(|trial| trial.trial).collect::<Vec<_>>(), [0, 40, 1, 2, 41]);
    assert_same(&trials, &trials_of(&ticks));
}

#[test]
fn without_a_writer_trials_are_still_delivered() {
    let (ticks, records) = study(4);
    let (handle, trials) = record(None, &ticks, &records);
    let status = handle.join();
    assert_eq!((status.bytes, status.ticks, status.error, status.finished), (0, 0, None, false));
    assert_same(&trials, &trials_of(&ticks));
}

#[test]
fn a_record_ahead_of_its_tick_makes_no_two_ticks_of_one_time_in_the_next_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let begin = |path: &Path, _| Writer::create(path, &session(), START_UTC_NS, &[]);
    let limits = RotationLimits { bytes: u64::MAX, duration_ns: 20_000_000 };
    let mut writer = SessionWriter::create(&path, limits, Box::new(begin)).unwrap();
    let ticks: Vec<Tick> = (1..=30).map(moving_tick).collect();
    let ahead = Stamped { time_ns: ticks[21].time_ns + 500_000, record: Record::Counters(Counters::default()) };
    for (index, tick) in ticks.iter().enumerate() {
        writer.tick(tick).unwrap();
        if index == 18 {
            writer.record(&ahead).unwrap();
        }
    }
    writer.finish().0.unwrap();
    let files = recordings_in(folder.path());
    assert_eq!(files.len(), 2, "{files:?}");
    let played = Timeline::open(&files).unwrap().filter_map(|played| match played {
        Played::Tick(tick) => Some(tick.time_ns),
        Played::Record(_) => None,
    });
    assert_eq!(played.collect::<Vec<_>>(), ticks.iter().map(|tick| tick.time_ns).collect::<Vec<_>>());
}

/// A disk that is full after some bytes and counts the syncs.
struct SmallDisk {
    left: usize,
    syncs: Arc<AtomicUsize>,
}

impl Write for SmallDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.left.min(bytes.len()) {
            0 => Err(io::Error::from(io::ErrorKind::StorageFull)),
            taken => {
                self.left -= taken;
                Ok(taken)
            }
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Sink for SmallDisk {
    fn sync(&mut self) -> io::Result<()> {
        self.syncs.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

fn on_small_disk(bytes: usize) -> (Writer, Arc<AtomicUsize>) {
    let syncs = Arc::new(AtomicUsize::new(0));
    let disk = SmallDisk { left: bytes, syncs: syncs.clone() };
    (Writer::into_sink(Box::new(disk), "small-disk.mcap", &session(), START_UTC_NS, &[]).unwrap(), syncs)
}

#[test]
fn a_failing_disk_is_reported_and_trials_are_still_delivered() {
    let (ticks, records) = study(4);
    for bytes in [100_000, 300_000, 1_000_000] {
        let (writer, _) = on_small_disk(bytes);
        let (handle, trials) = record(Some(writer), &ticks, &records);
        let status = handle.join();
        let error = status.error.expect("the disk is full");
        assert!(error.starts_with("small-disk.mcap: could not write: "), "{error}");
        assert!(
            !status.finished && status.ticks < 4000 && status.bytes <= bytes as u64,
            "{} {}",
            status.ticks,
            status.bytes
        );
        assert_same(&trials, &trials_of(&ticks));
    }
}

#[test]
fn a_disk_that_fails_in_the_last_moment_is_announced_too() {
    let (writer, _) = on_small_disk(1_000_000);
    let (handle, trials) = record(Some(writer), &study(1).0[..40], &[]);
    let whole = handle.join();
    assert_eq!((whole.error, whole.finished, trials.len()), (None, true, 0));
    // The same, but the disk is full one byte before the end of the file.
    let file = tempfile::tempdir().unwrap();
    let path = file.path().join("small-disk.mcap");
    let mut writer = Writer::create(&path, &session(), START_UTC_NS, &[]).unwrap();
    study(1).0[..40].iter().for_each(|tick| writer.tick(tick).unwrap());
    writer.finish().unwrap();
    let (writer, _) = on_small_disk(std::fs::metadata(&path).unwrap().len() as usize - 1);
    let status = record(Some(writer), &study(1).0[..40], &[]).0.join();
    assert!(status.error.is_some() && !status.finished, "{status:?}");
}

#[test]
fn a_judged_trial_is_synced_to_the_disk() {
    let (ticks, records) = study(6);
    let (writer, syncs) = on_small_disk(usize::MAX);
    let before = syncs.load(Ordering::Relaxed);
    record(Some(writer), &ticks, &records).0.join();
    // Three trials were judged; finishing syncs once more.
    assert_eq!(syncs.load(Ordering::Relaxed) - before, 3 + 1);
}

#[test]
fn a_recording_of_a_session_that_runs_can_be_played() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let writer = Writer::create(&path, &session(), START_UTC_NS, &[]).unwrap();
    let (mut ring, consumer) = rtrb::RingBuffer::new(2048);
    let (sender, receiver) = mpsc::channel();
    let (trial_sender, _trials) = mpsc::channel();
    let handle = Recorder::spawn(consumer, receiver, Some(writer.into()), trial_sender).unwrap();
    for number in 0..500 {
        ring.push(moving_tick(number)).unwrap();
    }
    // Within the second after which everything is flushed, however slow this machine is.
    let part = folder.path().join("session.mcap.part");
    while Player::open(&part).unwrap().count() < 501 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(
        Player::open(&part).unwrap().damage().is_some_and(|damage| damage.parts.contains("its end was not written"))
    );
    assert!(!handle.is_finished());
    assert_eq!(handle.status().error, None);
    drop((ring, sender));
    assert_eq!(handle.join().ticks, 500);
    assert_eq!(play(&path).len(), 500);
}

/// The last ticks go with a fault, in a trial or outside of one, and again with the next fault.
#[test]
fn the_last_200_ticks_are_delivered_with_each_fault() {
    let (mut ring, consumer) = rtrb::RingBuffer::new(4096);
    let (sender, receiver) = mpsc::channel();
    let (handed_in, handed) = mpsc::channel();
    let handle = Recorder::spawn(consumer, receiver, None, handed_in).unwrap();
    for number in 0..1000 {
        let faulty = (100..150).contains(&number) || (700..800).contains(&number);
        let mode = if faulty { Mode::Fault } else { Mode::Disarmed };
        ring.push(Tick { number, mode, ..Tick::default() }).unwrap();
    }
    drop((ring, sender));
    let kept: Vec<Vec<u64>> = handed
        .into_iter()
        .map(|handed| match handed {
            CollectedTicks::Fault(ticks) => ticks.iter().map(|tick| tick.number).collect(),
            CollectedTicks::Trial(trial) => panic!("there was no trial, and here is {}", trial.trial),
        })
        .collect();
    handle.join();
    assert_eq!(kept, [(0..=100).collect::<Vec<_>>(), (501..=700).collect()]);
    assert_eq!(kept[1].len(), FAULT_TICKS);
}
