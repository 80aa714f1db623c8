//! Several recordings of a study as one.

use std::path::Path;

use crate::recording::{MS, START_UTC_NS, session};
use quadfrog::recording::record::{Record, Stamped};
use quadfrog::recording::session_files::{next_recording, recordings_in};
use quadfrog::recording::timeline::Timeline;
use quadfrog::recording::writer::Writer;
use quadfrog::trial::{TrialRecord, Verdict};

/// Writes a recording whose engine started `hours` before the others', with a verdict on trial 0.
fn write(path: &Path, hours: u64, verdict: Verdict) {
    let mut writer = Writer::create(path, &session(), START_UTC_NS - hours * 3_600_000 * MS, &[]).unwrap();
    let row = TrialRecord { verdict: Some(verdict), ..TrialRecord::default() };
    writer.record(&Stamped { time_ns: 1_000 * MS, record: Record::Trial(row) }).unwrap();
    writer.finish().unwrap();
}

/// Regression: after a clock set back between two sessions the verdict of the first one was shown.
#[test]
fn a_clock_set_back_between_two_sessions_does_not_change_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["session.mcap", "session-2.mcap"].map(|name| folder.path().join(name));
    write(&first, 0, Verdict::Accept);
    let mut followed = Timeline::open(std::slice::from_ref(&first)).unwrap();
    write(&second, 1, Verdict::Void);
    assert!(followed.refresh().unwrap());
    let opened = Timeline::open(&recordings_in(folder.path())).unwrap();
    for timeline in [opened, followed] {
        assert_eq!(timeline.paths(), [first.clone(), second.clone()]);
        assert_eq!(timeline.rows()[&0].verdict, Some(Verdict::Void));
    }
    // Of another folder nothing but the time is known.
    let elsewhere = tempfile::tempdir().unwrap();
    let other = elsewhere.path().join("session-3.mcap");
    write(&other, 2, Verdict::Fall);
    let all = Timeline::open(&[second.clone(), first.clone(), other.clone()]).unwrap();
    assert_eq!(all.paths(), [other, first, second]);
}

/// Regression: a session that began after the first recording had been removed took its name, and with it its place.
#[test]
fn a_new_recording_has_a_higher_number_than_all_others() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(next_recording(folder.path(), None), Some(folder.path().join("session.mcap")));
    std::fs::write(folder.path().join("session-4.mcap.part"), "").unwrap();
    assert_eq!(next_recording(folder.path(), None), Some(folder.path().join("session-5.mcap")));
}
