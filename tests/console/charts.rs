//! The charts of the live view: every signal, axes, limits, commands beside measurements.

use crate::support::{Console, assert_shows, line_with, proposal, session, tick, trial};
use quadfrog::recording::record::Record;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JOINTS, joint_name};
use quadfrog::telemetry::{Mode, Phase, Snapshot, Tick};
use quadfrog::trial::{Backend, ExperimentStage, Verdict};
use quadfrog_console::message::Msg;
use quadfrog_console::series::Series;
use quadfrog_console::settings::{ConsoleSettings, DEFAULT};
use quadfrog_console::theme::{Colours, Glyphs, Theme};

/// A console whose charts are these.
fn charting(series: &[&str]) -> Console {
    let mut table: toml::Table = DEFAULT.parse().expect("the defaults");
    table.insert("chart_series".into(), series.to_vec().into());
    let settings = ConsoleSettings::from_table(&table).unwrap_or_else(|error| panic!("{series:?}: {error}"));
    let mut console = Console::with(settings, Theme::new(Colours::None, Glyphs::Braille));
    console.model.robot = Some(RobotDescription::embedded("go1").expect("the robot"));
    console
}

/// Different values of all signals.
fn distinct(time_ms: u64) -> Tick {
    let mut tick = tick(time_ms, 0.011, None);
    let estimate = &mut tick.estimate;
    estimate.roll_pitch_yaw = [0.011, 0.012, 0.013].into();
    estimate.position_world = [0.021, 0.022, 0.323].into();
    estimate.velocity_world = [0.031, 0.032, 0.033].into();
    tick.state.imu.gyro_body = [0.041, 0.042, 0.043].into();
    tick.state.imu.accel_body = [0.051, 0.052, 9.81].into();
    tick.theta_rad = 0.061;
    for leg in 0..4 {
        estimate.foot_position_leg[leg] = [0.0, 0.0, -0.201 - leg as f64 / 1e3].into();
        tick.state.foot_force_n[leg] = 11.5 + leg as f64;
    }
    for joint in 0..JOINTS {
        let step = joint as f64 / 1e3;
        tick.state.joint_position_rad[joint] = 0.1 + step;
        tick.state.joint_torque_n_m[joint] = 0.2 + step;
        tick.state.joint_velocity_rad_s[joint] = 0.3 + step;
        tick.state.motor_temperature_c[joint] = 30.0 + step;
    }
    tick
}

/// Name, value and unit of every signal in [`distinct`].
fn signals() -> Vec<(String, f64, &'static str)> {
    let fixed = [
        ("roll", 0.011, "rad"),
        ("pitch", 0.012, "rad"),
        ("yaw", 0.013, "rad"),
        ("x", 0.021, "m"),
        ("y", 0.022, "m"),
        ("height", 0.323, "m"),
        ("x velocity", 0.031, "m/s"),
        ("y velocity", 0.032, "m/s"),
        ("z velocity", 0.033, "m/s"),
        ("gyro x", 0.041, "rad/s"),
        ("gyro y", 0.042, "rad/s"),
        ("gyro z", 0.043, "rad/s"),
        ("accelerometer x", 0.051, "m/s2"),
        ("accelerometer y", 0.052, "m/s2"),
        ("accelerometer z", 9.81, "m/s2"),
        ("oscillator", 0.061, "rad"),
    ];
    let mut signals: Vec<_> = fixed.map(|(name, value, unit)| (name.to_owned(), value, unit)).into();
    for (leg, name) in ["FR", "FL", "RR", "RL"].into_iter().enumerate() {
        signals.push((format!("{name} foot z"), -0.201 - leg as f64 / 1e3, "m"));
        signals.push((format!("{name} force"), 11.5 + leg as f64, "N"));
    }
    for joint in 0..JOINTS {
        let (name, step) = (joint_name(joint), joint as f64 / 1e3);
        signals.push((format!("{name} angle"), 0.1 + step, "rad"));
        signals.push((format!("{name} torque"), 0.2 + step, "N m"));
        signals.push((format!("{name} speed"), 0.3 + step, "rad/s"));
        signals.push((format!("{name} temperature"), 30.0 + step, "C"));
    }
    signals
}

#[test]
fn every_signal_can_be_charted_with_its_value_and_its_unit() {
    let signals = signals();
    assert_eq!(signals.len(), 72);
    for (name, value, unit) in &signals {
        let mut console = charting(&[name.as_str()]);
        (0..200).for_each(|step| drop(console.update(Msg::Tick(Box::new(distinct(5 * step))))));
        let screen = console.screen(120, 40);
        let heading = screen.lines().nth(3).unwrap_or_default();
        assert!(heading.starts_with(name.as_str()), "{name}: {heading}");
        assert!(heading.contains(&format!(" {value:+.3} {unit} ")), "{name}, {value} {unit}: {heading}");
    }
    // The list offers the same.
    let mut console = charting(&["roll"]);
    console.press(&["T"]);
    let names: Vec<String> = (0..72)
        .map(|_| {
            let screen = console.screen(200, 100);
            console.press(&["Down"]);
            screen
        })
        .last()
        .expect("a screen")
        .lines()
        .filter_map(|line| {
            line.split_once("] ").map(|(_, rest)| rest.split("  ").next().unwrap_or_default().to_owned())
        })
        .collect();
    for (name, ..) in &signals {
        assert!(names.iter().any(|shown| shown.starts_with(name.as_str())), "{name} is not among {names:?}");
    }
}

#[test]
fn a_wide_chart_has_ticks_on_both_axes() {
    let mut console = charting(&["roll", "FR_hip temperature"]);
    (0..400).for_each(|step| drop(console.update(Msg::Tick(Box::new(distinct(5 * step))))));
    let screen = console.screen(120, 40);
    let lines: Vec<&str> = screen.lines().collect();
    assert!(lines[4].starts_with(" 0.25 ") && lines[4].contains("   80 "), "{screen}");
    assert!(lines.iter().any(|line| line.starts_with("-0.25 ") && line.contains("   20 ")), "{screen}");
    // The middle is no fraction of many digits.
    let mut feet = charting(&["FR foot z", "FL foot z"]);
    feet.tick(distinct(5));
    let middle = feet.screen(120, 40).lines().find(|line| line.starts_with(" -0.2 ")).map(str::to_owned);
    assert!(middle.is_some(), "{}", feet.screen(120, 40));
    // The marks of a sweep stay where they are, those of a scroll count back from the newest.
    let times = lines.iter().find(|line| line.contains("0 s")).expect("a time axis");
    assert!(times.starts_with("      0 s"), "{times:?}");
    for mark in [" 2 ", " 4 ", " 6 "] {
        assert!(times.contains(mark), "{times:?}");
    }
    console.press(&["w"]);
    assert_shows(&console.screen(120, 40), &["-6 ", "-4 ", "-2 ", "0 s"]);
}

#[test]
fn every_chart_of_the_smallest_terminal_has_a_scale() {
    let mut console = charting(&["roll", "pitch", "FR foot z", "FL foot z", "RR foot z", "RL foot z"]);
    (0..400).for_each(|step| drop(console.update(Msg::Tick(Box::new(distinct(5 * step))))));
    let screen = console.screen(80, 24);
    let lines: Vec<&str> = screen.lines().collect();
    for series in ["roll", "pitch", "FR foot z", "FL foot z", "RR foot z", "RL foot z"] {
        let row = lines.iter().position(|line| line.contains(series)).expect("its heading");
        let column = lines[row][..lines[row].find(series).expect("its heading")].chars().count();
        let axis: String = lines[row + 1].chars().skip(column).take(5).collect();
        assert!(axis.trim().parse::<f64>().is_ok(), "{series} has no scale: `{axis}`\n{screen}");
    }
}

#[test]
fn limits_are_lines_where_they_are_known() {
    let lines = |series: &str, tilt: Option<[f64; 2]>| {
        let mut console = charting(&[series]);
        console.model.fall_tilt_rad = tilt;
        let mut newest = distinct(5);
        newest.estimate.roll_pitch_yaw = [0.8, 0.8, 0.8].into();
        newest.state.joint_torque_n_m[0] = 28.0;
        console.update(Msg::Tick(Box::new(newest)));
        console.screen(120, 40).lines().filter(|line| line.contains("╌╌") || line.contains("╌ ╌")).count()
    };
    assert_eq!(lines("roll", Some([0.9, 0.5])), 2, "both ends of the roll that is no fall");
    assert_eq!(lines("pitch", Some([0.9, 0.5])), 2);
    assert_eq!(lines("roll", None), 0, "not known in a replay");
    assert_eq!(lines("yaw", Some([0.9, 0.5])), 0, "there is no limit");
    assert_eq!(lines("FR_hip torque", None), 2, "of the motor");
    assert_eq!(lines("FR_hip temperature", None), 1, "the warning");
}

#[test]
fn the_command_is_dotted_beside_the_measurement() {
    let screen = |stiffness: f64| {
        let mut console = charting(&["FR_hip angle"]);
        for step in 0..400 {
            let mut tick = distinct(5 * step);
            tick.command.motor[0].position_rad = 0.8;
            tick.command.motor[0].kp_joint = stiffness;
            console.update(Msg::Tick(Box::new(tick)));
        }
        console.screen(120, 40)
    };
    let dots = |screen: &str| screen.chars().filter(|c| ('\u{2801}'..='\u{28ff}').contains(c)).count();
    let (commanded, limp) = (screen(50.0), screen(0.0));
    assert!(dots(&commanded) > dots(&limp) + 5, "{commanded}\n{limp}");
}

/// Regression: the roll of a robot on its back, which jumps from pi to -pi and back, filled the chart.
#[test]
fn no_line_joins_two_angles_that_a_whole_turn_separates() {
    let mut console = charting(&["roll"]);
    console.ticks(0..2_000, |time_ms| if time_ms % 10 == 0 { 3.13 } else { -3.13 });
    let screen = console.screen(120, 40);
    // The chart ends at the line of its side panel, with the description of its axis.
    let chart = screen.lines().map(|row| row.chars().take(76).collect::<String>());
    let chart = chart.skip_while(|row| !row.starts_with("roll")).take_while(|row| !row.contains("sweep"));
    let rows = chart.filter(|row| row.contains(|c| ('\u{2801}'..='\u{28ff}').contains(&c))).count();
    assert_eq!(rows, 2, "the two values and nothing between:\n{screen}");
}

#[test]
fn twelve_joints_are_in_numbers_at_120x40_in_one_order() {
    let mut console = charting(&["roll", "pitch"]);
    let mut newest = distinct(5);
    newest.state.joint_torque_n_m[0] = -0.04;
    newest.state.joint_torque_n_m[11] = -12.3;
    console.update(Msg::Snapshot(Box::new(Snapshot { tick: newest, ..console.model.snapshot })));
    let screen = console.screen(120, 40);
    let places: Vec<(usize, usize)> = (0..JOINTS)
        .map(|joint| {
            let name = format!("{} ", joint_name(joint));
            let (row, line) = screen.lines().enumerate().find(|(_, line)| line.contains(&name)).expect(&name);
            (line.find(&name).expect("found"), row)
        })
        .collect();
    assert!(places.is_sorted(), "FR FL RR RL, hip thigh calf: {places:?}\n{screen}");
    assert_shows(&screen, &["-12.3"]);
    assert!(!screen.contains("-0.0 "), "{screen}");
}

/// Regression: beside a plot of two rows the lowest value stood in the row of zero.
#[test]
fn a_chart_of_two_rows_names_its_range_and_no_row() {
    let mut console = charting(&["roll"]);
    (0..200).for_each(|step| drop(console.update(Msg::Tick(Box::new(distinct(5 * step))))));
    let torques = |console: &mut Console, columns, rows| {
        (0..7)
            .map(|_| {
                console.press(&["t"]);
                console.screen(columns, rows)
            })
            .find(|screen| screen.contains("FR_hip torque"))
            .expect("torques")
    };
    let screen = torques(&mut console, 120, 40);
    assert_shows(&line_with(&screen, "FR_hip torque"), &["-10 to 10"]);
    for row in screen.lines().skip_while(|line| !line.contains("FR_hip torque")).skip(1).take(2) {
        assert!(row.starts_with("      "), "no value beside {row}\n{screen}");
    }
    // Without room in the heading.
    let screen = torques(&mut console, 80, 24);
    let rows: Vec<&str> = screen.lines().skip_while(|line| !line.contains("FR_hip torque")).take(3).collect();
    assert!(rows[1].starts_with("  ±10 ") && rows[2].starts_with("      "), "{screen}");
    // Where there are more rows, each value stands beside its own.
    let screen = torques(&mut console, 120, 60);
    assert!(!line_with(&screen, "FR_hip torque").contains("-10 to 10"), "{screen}");
}

/// Regression: before the feet of a simulated robot were loaded in the countdown, they were said to be in the air.
#[test]
fn no_foot_is_in_the_air_while_a_simulated_robot_is_placed() {
    let mut console = charting(&["FR foot z", "RR foot z"]);
    console.record(Record::Session(session()));
    let mut placed = |backend, contact: bool| {
        console.model.session.info.backend = Some(backend);
        let mut tick = tick(1_000, 0.0, Some((4, -2.0, Phase::Stance)));
        tick.state.robot_time_ms = 1_000;
        tick.estimate.contact = [contact; 4];
        console.update(Msg::Snapshot(Box::new(Snapshot { tick, ..console.model.snapshot })));
        console.tick(tick);
        console.screen(120, 40)
    };
    let screen = placed(Backend::Simulator, false);
    assert!(screen.contains("being placed") && !screen.contains('○'), "{screen}");
    assert_shows(&placed(Backend::Simulator, true), &["FR● FL● RR● RL●", "FR foot z●"]);
    // A real robot stands where it stands.
    assert_shows(&placed(Backend::Hardware, false), &["FR○ FL○ RR○ RL○", "FR foot z○"]);
}

/// Regression: feet of the end of the trial and of the present stood side by side without a word.
#[test]
fn the_picture_says_that_it_shows_the_present_where_the_charts_do_not() {
    let mut console = charting(&["FR foot z"]);
    console.record(Record::Session(session()));
    console.record(Record::Proposal(proposal(0, 0)));
    console.stage(ExperimentStage::Running, 0);
    for time_ms in (0..1_000).step_by(5) {
        console.tick(tick(time_ms, 0.0, Some((0, time_ms as f64 / 1e3 - 0.5, Phase::Flight))));
    }
    assert_shows(&console.screen(200, 60), &["Robot ─"]);
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 0);
    console.mode(Mode::Review);
    assert_shows(&console.screen(200, 60), &["Robot now ─"]);
    // The charts show the present, too.
    console.press(&["z"]);
    assert_shows(&console.screen(200, 60), &["Robot ─"]);
}

/// Regression: the next set of `t` dropped the chosen series, and no key showed them again.
#[test]
fn the_chosen_series_are_one_of_the_sets() {
    let mut console = charting(&["roll", "pitch"]);
    (0..200).for_each(|step| drop(console.update(Msg::Tick(Box::new(distinct(5 * step))))));
    let shows_the_choice = |console: &mut Console| {
        let screen = console.screen(120, 40);
        ["roll", "pitch", "height"].iter().all(|name| screen.contains(name)) && !screen.contains("FR foot z")
    };
    // The height of the trunk is the seventh of the list.
    console.press(&["T", "Down", "Down", "Down", "Down", "Down", "Down", "x", "Esc"]);
    assert!(shows_the_choice(&mut console));
    let again = (1..10).find(|_| {
        console.press(&["t"]);
        shows_the_choice(&mut console)
    });
    assert_eq!(again, Some(7), "joints, the robot and four sets are before it");
}

/// Regression: in a view without charts the keys of the charts changed those of Live, without a word.
#[test]
fn keys_of_the_charts_are_refused_where_no_chart_is_seen() {
    let mut console = charting(&["roll"]);
    console.press(&["6"]);
    for key in ["t", "w", "+", "-"] {
        console.press(&[key]);
        assert_shows(console.said(), &["is not possible: the charts are in the view Live"]);
    }
    assert_eq!(console.model.live.series, [Series::Roll]);
}
