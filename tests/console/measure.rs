//! Measurements of the console, printed without limits. Run them with
//! `cargo test --release -p quadfrog-console --test measure -- --ignored --nocapture --test-threads 1`.

#[path = "support/pty.rs"]
mod pty;

use std::time::{Duration, Instant};

use pty::Session;

/// A percentile, as a share, of sorted durations.
fn percentile(sorted: &[Duration], share: f64) -> Duration {
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

/// Processor time of a process, s.
fn processor_time(pid: i32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).expect("its state");
    // Fields 14 and 15 (user and system time, 1/100 s), counted after the name, which may contain spaces.
    let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
    fields[11..13].iter().map(|ticks| ticks.parse::<f64>().expect("a number") / 100.0).sum()
}

/// Prints data rate and processor load of one minute of a session with two jumps.
fn minute(name: &str, size: (u16, u16), arguments: &[&str]) {
    let (_folder, mut session) = Session::opened(size, arguments);
    session.send("A");
    session.wait_for(&["Press g twice"]);
    let (begun, bytes, used) = (Instant::now(), session.bytes(), processor_time(session.pid().as_raw()));
    for _ in 0..2 {
        session.approve();
        session.wait_for(&["judge it"]);
        session.send("v");
        session.wait_until("the next proposal", || !session.screen().contains("judge it"));
        if session.screen().contains("DAMPED") {
            session.send("k");
            session.wait_for(&["Press A to arm"]);
        }
        if session.screen().contains("DISARMED") {
            session.send("A");
        }
        session.wait_for(&["Press g twice"]);
    }
    std::thread::sleep(Duration::from_secs(60).saturating_sub(begun.elapsed()));
    let seconds = begun.elapsed().as_secs_f64();
    let kilobits = (session.bytes() - bytes) as f64 * 8.0 / 1e3 / seconds;
    let share = (processor_time(session.pid().as_raw()) - used) / seconds * 100.0;
    println!("{name}: {kilobits:.1} kbit/s, {share:.0} % of one core with simulator and recorder, over {seconds:.0} s");
    session.send("qy");
    session.wait();
}

#[test]
#[ignore = "a measurement of four minutes"]
fn bytes_on_the_wire_and_processor() {
    minute("80x24 sweep", (80, 24), &[]);
    minute("120x40 sweep", (120, 40), &[]);
    minute("200x60 sweep", (200, 60), &[]);
    minute("80x24 low bandwidth", (80, 24), &["--low-bandwidth"]);
}

#[test]
#[ignore = "a measurement"]
fn bytes_of_the_first_frame() {
    for arguments in [&[][..], &["--low-bandwidth"]] {
        for size in [(80, 24), (120, 40), (200, 60)] {
            let (_folder, mut session) = Session::opened(size, arguments);
            // The second frame ends here for certain.
            std::thread::sleep(Duration::from_millis(150));
            let all = session.sent_bytes();
            let chart = all.windows(5).position(|part| part == b" roll" || part == b"roll ").expect("a chart");
            // The first frame is without the robot's picture and joints, which the second adds.
            let mut ends = session.bytes_before_pauses().into_iter().filter(|bytes| *bytes > chart);
            let mut next = || ends.next().unwrap_or(all.len());
            let (first, second) = (next(), next());
            let seconds = |bytes: usize| bytes as f64 * 8.0 / 20e3;
            println!(
                "{}x{} {arguments:?}: {first} bytes, {:.1} s at 20 kbit/s; with the robot {second} bytes, {:.1} s",
                size.0,
                size.1,
                seconds(first),
                seconds(second)
            );
            session.send("q");
            session.wait();
        }
    }
}

#[test]
#[ignore = "a measurement"]
fn key_to_screen() {
    let (_folder, mut session) = Session::opened((80, 24), &[]);
    let mut times = Vec::new();
    for round in 0..200 {
        let (key, shown) = if round % 2 == 0 { ("?", "Keys (1") } else { ("\x1b", "Press A to arm") };
        let begun = Instant::now();
        session.send(key);
        while !session.screen().contains(shown) {
            std::thread::sleep(Duration::from_micros(200));
        }
        times.push(begun.elapsed());
        std::thread::sleep(Duration::from_millis(37));
    }
    times.sort();
    println!(
        "key to screen: p50 {:.1} ms, p99 {:.1} ms, longest {:.1} ms of {}",
        percentile(&times, 0.5).as_secs_f64() * 1e3,
        percentile(&times, 0.99).as_secs_f64() * 1e3,
        times[times.len() - 1].as_secs_f64() * 1e3,
        times.len()
    );
    session.send("q");
    session.wait();
}
