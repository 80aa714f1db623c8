//! Texts of 80 columns and 24 rows that a reader without the manual understands.

use crate::support::{Console, assert_shows, line_with, session, trial};
use quadfrog::recording::record::Record;
use quadfrog::trial::{ExperimentStage, PointRecord, Verdict};
use quadfrog_console::message::Msg;

/// A finished study with two points that were repeated.
fn repeated(unit: &str, confidence: Option<f64>) -> Console {
    let mut console = Console::ready();
    let mut info = session();
    info.unit = unit.to_owned();
    console.record(Record::Session(info));
    console.record(Record::Trial(trial(12, Some(Verdict::Accept), None)));
    console.stage(ExperimentStage::Finished, 20);
    let point = |trials: Vec<u32>, without_fall, mean, confidence| PointRecord {
        parameters: vec![("f0".into(), 1.25)].into(),
        trials,
        without_fall,
        mean,
        deviation: Some(0.05),
        contender: true,
        confidence,
    };
    console.record(Record::Points(vec![
        point(vec![12, 20], 2, 0.442, confidence),
        point((30..40).collect(), 9, -0.41, None),
    ]));
    console
}

/// Regression: `2/2  0.442 m ±0.000` stood below "Study finished" without a word.
#[test]
fn the_numbers_of_repeated_points_have_names_at_80_columns() {
    let screen = repeated("m", Some(0.96)).screen(80, 24);
    assert_shows(&line_with(&screen, "landed"), &["#   landed mean, std m   leads"]);
    assert_shows(&screen, &["#12 2/2    0.442 ±0.050  96 %", "#30 9/10   -0.410 ±0.050\n"]);
    let screen = repeated("rad", None).screen(80, 24);
    assert_shows(&screen, &["#   landed mean, std rad\n", "#12 2/2    0.442 ±0.050\n"]);
    // On a wide terminal each line has its words.
    assert_shows(&repeated("m", Some(0.96)).screen(200, 60), &["2/2 landed  0.442 m ±0.050  leads, 96 %"]);
    // A study without repeats has no such line.
    let mut console = repeated("m", None);
    console.record(Record::Points(Vec::new()));
    assert!(!console.screen(80, 24).contains("mean, std"), "{}", console.screen(80, 24));
}

/// Regression: `columns (x)` and `by number (s)` went as the counts grew.
#[test]
fn the_keys_in_the_heading_of_trials_stay_while_the_counts_grow() {
    let keys = "by number (s), all (F), columns (x)";
    let mut console = Console::ready();
    console.press(&["2"]);
    for count in [3, 30, 300, 999] {
        console.judged(count);
        assert_shows(&console.screen(80, 24), &[keys]);
        assert_shows(&console.screen(120, 40), &["void", keys]);
    }
    // The order with the longest name.
    for _ in 0..20 {
        console.press(&["s"]);
        assert_shows(&console.screen(80, 24), &["(s), all (F), columns (x)"]);
    }
    console.press(&["S", "F"]);
    assert_shows(&console.screen(80, 24), &["reversed (s), only accept (F), columns (x)"]);
}

/// Regression: the times of the stages took two lines once they had two digits.
#[test]
fn the_times_of_the_stages_have_one_line_at_80_columns() {
    let mut console = Console::ready();
    console.press(&["5"]);
    for (stages_ns, shown) in
        [([12_300, 25_000, 13_000], "12, 25, 13 us"), ([100_000, 250_000, 130_000], "100, 250, 130 us")]
    {
        let [read_ns, decide_ns, write_ns] = stages_ns;
        let mut snapshot = console.model.snapshot;
        (snapshot.tick.stages.read_ns, snapshot.tick.stages.decide_ns) = (read_ns, decide_ns);
        snapshot.tick.stages.write_ns = write_ns;
        console.update(Msg::Snapshot(Box::new(snapshot)));
        let screen = console.screen(80, 24);
        assert_shows(&screen, &[&format!("read, decide, write {shown} ")]);
        let at = screen.lines().position(|line| line.starts_with("read, decide, write")).expect("the line");
        assert!(!screen.lines().nth(at + 1).unwrap_or_default().starts_with("    "), "{screen}");
    }
}
