//! Times at which a command with the guard's bytes is the guard's: after a silence of this program, and at no other time.

use quadfrog::robot::go2::own_writes::OwnWrites;

const MS: u64 = 1_000_000;
/// Any time since boot.
const START_MS: u64 = 5000;

/// Notes a command every millisecond of `span`.
fn write(writes: &mut OwnWrites, span: std::ops::Range<u64>) {
    span.for_each(|ms| writes.note(ms * MS));
}

#[test]
fn the_guard_speaks_only_after_a_silence() {
    let mut writes = OwnWrites::default();
    let may = |writes: &OwnWrites, ms: u64| writes.guard_may_speak(ms * MS);
    assert!(!may(&writes, 0) && !may(&writes, START_MS), "a console that only observes has a silent guard");
    write(&mut writes, START_MS..START_MS + 1000);
    for ms in [999, 1000, 1020] {
        assert!(!may(&writes, START_MS + ms), "{ms} ms: this program speaks");
    }
    // The guard speaks 50 ms after the last heartbeat at the earliest, which is 20 ms older than the last command on the network.
    assert!(may(&writes, START_MS + 1030) && may(&writes, START_MS + 9000), "silent");
}

/// After a stop of this process the first command is written before or after the guard's commands of the stop are taken.
#[test]
fn the_guards_commands_that_waited_during_a_stop_are_its_own() {
    let mut writes = OwnWrites::default();
    write(&mut writes, START_MS..START_MS + 1000);
    let continued_ms = START_MS + 60_000;
    assert!(writes.guard_may_speak(continued_ms * MS));
    write(&mut writes, continued_ms..continued_ms + 1000);
    assert!(writes.guard_may_speak((continued_ms + 199) * MS));
    assert!(!writes.guard_may_speak((continued_ms + 999) * MS));
}
