//! The picture of the robot in view Live: legs, attitude, path and landing spots.

use crate::support::{Console, tick, trial};
use quadfrog::config::Config;
use quadfrog::recording::record::Record;
use quadfrog::robot::description::RobotDescription;
use quadfrog::sim::TerrainKind;
use quadfrog::telemetry::{Mode, Phase, Tick};
use quadfrog::trial::{Backend, ExperimentStage, TrialRecord, Verdict};
use quadfrog_console::model::{Model, RobotFacts};
use quadfrog_console::settings::ConsoleSettings;
use quadfrog_console::theme::{Colours, Glyphs, Theme};
use ratatui::buffer::{Buffer, Cell};

/// Stance of the Go1, rad: hip, thigh, calf.
const STANCE_RAD: [f64; 3] = [0.0, 0.8, -1.6];

fn console(glyphs: Glyphs) -> Console {
    let mut console = Console::with(ConsoleSettings::built_in(), Theme::new(Colours::True, glyphs));
    console.model.robot = Some(RobotDescription::embedded("go1").expect("the robot"));
    show(&mut console, standing(1, [0.0, 0.0, 0.3], None));
    console
}

fn standing(time_ms: u64, position: [f64; 3], in_trial: Option<(u32, f64, Phase)>) -> Tick {
    let mut tick = tick(time_ms, 0.0, in_trial);
    tick.estimate.position_world = position.into();
    tick.state.joint_position_rad = std::array::from_fn(|joint| STANCE_RAD[joint % 3]);
    tick
}

/// Shows a tick as the newest one, and in the history.
fn show(console: &mut Console, tick: Tick) {
    console.tick(tick);
    console.model.snapshot.tick = tick;
}

/// The cells below the heading of the picture, row by row.
fn picture(console: &Console) -> Vec<Vec<Cell>> {
    let buffer: Buffer = console.draw(120, 40);
    let text = |row: u16| (0..120).map(|column| buffer.cell((column, row)).unwrap().symbol()).collect::<String>();
    let place = (0..40).find_map(|row| {
        Some((row, text(row).split("Robot ").next().filter(|_| text(row).contains("Robot "))?.chars().count()))
    });
    let (top, left) = place.expect("the picture of the robot");
    let below = (top + 1..40).take_while(|row| !text(*row).trim_start().starts_with('#'));
    below.map(|row| (left as u16..120).map(|column| buffer.cell((column, row)).unwrap().clone()).collect()).collect()
}

fn symbols(picture: &[Vec<Cell>]) -> String {
    picture.iter().map(|row| row.iter().map(Cell::symbol).collect::<String>() + "\n").collect()
}

/// First row with a cell for which `wanted` holds.
fn first_row(picture: &[Vec<Cell>], wanted: impl Fn(&Cell) -> bool) -> usize {
    picture.iter().position(|row| row.iter().any(&wanted)).expect("such a cell")
}

#[test]
fn near_and_far_legs_differ_and_a_robot_that_stands_does_not_change_the_picture() {
    for glyphs in [Glyphs::Braille, Glyphs::Ascii] {
        let mut console = console(glyphs);
        let before = picture(&console);
        let colours: std::collections::BTreeSet<String> =
            before.iter().flatten().filter(|cell| cell.symbol() != " ").map(|cell| format!("{:?}", cell.fg)).collect();
        assert!(colours.len() >= 3, "trunk, near legs, far legs and ground: {colours:?}");
        // The noise of an estimator moves no cell.
        show(&mut console, standing(2, [0.0004, -0.0003, 0.3002], None));
        assert_eq!(symbols(&picture(&console)), symbols(&before));
    }
}

#[test]
fn a_robot_on_its_back_has_its_feet_above_the_trunk() {
    let mut console = console(Glyphs::Braille);
    let theme = console.model.theme;
    let trunk = theme.style(quadfrog_console::theme::Role::SeriesA).fg.unwrap();
    let legs = theme.style(quadfrog_console::theme::Role::Text).fg;
    let is_leg = |cell: &Cell| cell.symbol() != " " && Some(cell.fg) == legs.or(Some(ratatui::style::Color::Reset));
    let upright = picture(&console);
    let lowest = |picture: &[Vec<Cell>], wanted: &dyn Fn(&Cell) -> bool| {
        picture.iter().rposition(|row| row.iter().any(wanted)).expect("such a cell")
    };
    let is_trunk = |cell: &Cell| cell.fg == trunk;
    assert!(lowest(&upright, &is_leg) > lowest(&upright, &is_trunk), "{}", console.screen(120, 40));
    let mut fallen = standing(2, [0.0, 0.0, 0.06], None);
    fallen.estimate.roll_pitch_yaw.x = std::f64::consts::PI;
    show(&mut console, fallen);
    let on_its_back = picture(&console);
    assert!(
        first_row(&on_its_back, is_leg) < first_row(&on_its_back, |cell| cell.fg == trunk),
        "{}",
        symbols(&on_its_back)
    );
}

/// Two trials: the second lands shorter than the first, which is the best.
#[test]
fn the_path_and_both_landing_spots_are_shown_after_the_landing() {
    let mut console = Console::ready();
    console.model.robot = Some(RobotDescription::embedded("go1").expect("the robot"));
    let jump = |console: &mut Console, number: u32, from_ms: u64, length_m: f64| {
        console.stage(ExperimentStage::Running, number);
        for step in 0..200_u64 {
            let share = step as f64 / 199.0;
            let height = 0.3 + 1.6 * share * (1.0 - share);
            let in_trial = Some((number, share, Phase::Flight));
            show(console, standing(from_ms + 5 * step, [length_m * share, 0.0, height], in_trial));
        }
        console.record(Record::Trial(trial(number, None, Some(Verdict::Accept))));
        console.stage(ExperimentStage::Review, number);
        console.mode(Mode::Review);
        show(console, standing(from_ms + 1001, [length_m, 0.0, 0.3], None));
    };
    jump(&mut console, 0, 1000, 0.6);
    let alone = symbols(&picture(&console));
    assert!(alone.contains('x') && !alone.contains('o'), "no best trial yet:\n{alone}");
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), Some(Verdict::Accept))));
    jump(&mut console, 1, 5000, 0.3);
    let picture = picture(&console);
    let column = |wanted: &str| picture.iter().find_map(|row| row.iter().position(|cell| cell.symbol() == wanted));
    let (landed, best) = (column("x").expect("the landing"), column("o").expect("the best landing"));
    assert!(best > landed + 2, "the best trial landed farther to the right:\n{}", symbols(&picture));
    // The path rises above the robot that stands at its end.
    let theme = console.model.theme;
    let path = theme.style(quadfrog_console::theme::Role::SeriesB).fg.unwrap();
    let trunk = theme.style(quadfrog_console::theme::Role::SeriesA).fg.unwrap();
    assert!(first_row(&picture, |cell| cell.fg == path) < first_row(&picture, |cell| cell.fg == trunk));
}

/// Regression: a robot that rolled on after its fall was drawn beyond the right edge.
#[test]
fn a_robot_that_rolls_on_after_its_trial_stays_in_the_picture() {
    let mut console = Console::ready();
    console.model.robot = Some(RobotDescription::embedded("go1").expect("the robot"));
    for step in 0..200_u64 {
        let share = step as f64 / 199.0;
        show(&mut console, standing(1000 + 5 * step, [0.8 * share, 0.0, 0.3], Some((0, share, Phase::Flight))));
    }
    console.record(Record::Trial(trial(0, None, Some(Verdict::Fall))));
    console.stage(ExperimentStage::Review, 0);
    console.mode(Mode::Damped);
    let trunk = console.model.theme.style(quadfrog_console::theme::Role::SeriesA).fg.unwrap();
    let trunk_cells = |console: &Console| picture(console).iter().flatten().filter(|cell| cell.fg == trunk).count();
    show(&mut console, standing(2001, [0.8, 0.0, 0.1], None));
    let before = trunk_cells(&console);
    show(&mut console, standing(2500, [1.9, 0.0, 0.1], None));
    let drawn = picture(&console);
    assert!(trunk_cells(&console) * 3 > before, "{before} cells before:\n{}", symbols(&drawn));
    assert!(drawn.iter().all(|row| row.last().is_none_or(|cell| cell.fg != trunk)), "{}", symbols(&drawn));
}

/// A console on a ground, before the first trial.
fn on_ground(change: impl Fn(&mut Config)) -> Console {
    let mut config = Config::load(None).expect("the built-in configuration");
    change(&mut config);
    let robot = RobotDescription::embedded("go1").expect("the robot");
    let facts = RobotFacts::new(robot, &config, Backend::Simulator, 0);
    let theme = Theme::new(Colours::True, Glyphs::Braille);
    let mut console = Console { model: Model::new(ConsoleSettings::built_in(), theme, facts) };
    show(&mut console, standing(1, [0.0, 0.0, 0.3], None));
    console
}

/// The picture moves with the robot along a slope, so that its feet stay on the ground that is drawn.
#[test]
fn the_ground_follows_a_slope() {
    let angle_rad = 0.2_f64;
    let mut console = on_ground(|config| {
        config.simulator.terrain.kind = TerrainKind::Slope;
        config.simulator.terrain.slope.angle_rad = angle_rad;
        config.simulator.terrain.slope.heading_rad = 0.0;
    });
    let begin = symbols(&picture(&console));
    assert_ne!(begin, symbols(&picture(&on_ground(|_| {}))), "the slope is drawn");
    show(&mut console, standing(2, [3.0, 0.0, 0.3 + 3.0 * angle_rad.tan()], None));
    assert_eq!(symbols(&picture(&console)), begin);
}

/// Steps and blocks of the trial's seed are drawn; another seed has other blocks.
#[test]
fn steps_and_blocks_are_drawn() {
    let flat = symbols(&picture(&on_ground(|_| {})));
    let steps = symbols(&picture(&on_ground(|config| config.simulator.terrain.kind = TerrainKind::Steps)));
    assert_ne!(steps, flat);
    let mut console = on_ground(|config| config.simulator.terrain.kind = TerrainKind::Blocks);
    let before = symbols(&picture(&console));
    assert!(before != flat && before != steps);
    let row = TrialRecord { seed: Some(77), ..trial(0, None, None) };
    console.record(Record::Trial(row));
    console.stage(ExperimentStage::Running, 0);
    assert_ne!(symbols(&picture(&console)), before, "the blocks of the trial's seed");
}

/// The path of each foot is drawn while the foot is in the air.
#[test]
fn the_feet_leave_a_path_in_the_air() {
    let mut console = on_ground(|_| {});
    console.stage(ExperimentStage::Running, 0);
    let jump = |console: &mut Console, contact: bool| {
        for step in 0..100_u64 {
            let share = step as f64 / 99.0;
            let height = 0.3 + 1.2 * share * (1.0 - share);
            let phase = Phase::Flight;
            let mut tick =
                standing(1000 + 5 * step, [0.6 * share, 0.0, height], Some((u32::from(contact), share, phase)));
            tick.estimate.contact = [contact; 4];
            show(console, tick);
        }
        picture(console).iter().flatten().filter(|cell| cell.symbol() != " ").count()
    };
    let (in_air, on_ground) = (jump(&mut console, false), jump(&mut console, true));
    assert!(in_air > on_ground + 10, "{in_air} cells with paths of feet, {on_ground} without");
}

/// The last set of the charts' key shows the picture over the whole width.
#[test]
fn the_picture_fills_the_view() {
    let mut console = console(Glyphs::Braille);
    let cells = |console: &Console| picture(console).iter().flatten().filter(|cell| cell.symbol() != " ").count();
    let small = cells(&console);
    console.press(&["t"; 5]);
    let large = cells(&console);
    assert!(large > 2 * small, "{large} cells, {small} before:\n{}", console.screen(120, 40));
}
