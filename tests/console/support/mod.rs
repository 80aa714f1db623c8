//! A console without a terminal: input of keys and records, output of effects and of the screen as text.

#![allow(dead_code, reason = "each test program uses a part")]

use std::ops::Range;
use std::time::Duration;

use quadfrog::optimize::ask::SamplerKind;
use quadfrog::recording::record::{
    ArmingCheckRecord, Record, RequestRecord, SessionInfo, StageRecord, Stamped, Transition,
};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState, Mode, Phase, Snapshot, Tick};
use quadfrog::trial::{
    Backend, ExperimentStage, MeasuredJump, ParameterInfo, Proposal, ProposalSource, ProposedParameter, Task,
    TrialRecord, Verdict,
};
use quadfrog_console::keymap::Key;
use quadfrog_console::message::{Effect, Msg};
use quadfrog_console::model::{Model, RobotFacts};
use quadfrog_console::settings::ConsoleSettings;
use quadfrog_console::theme::{Colours, Glyphs, Theme};
use quadfrog_console::update::update;
use quadfrog_console::view;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::Color;

/// The keys of the views.
pub const VIEWS: [&str; 6] = ["1", "2", "3", "4", "5", "6"];

/// A console under test.
pub struct Console {
    pub model: Model,
}

impl Console {
    /// Braille, 16 colours, no session.
    pub fn new() -> Console {
        Console::with(ConsoleSettings::built_in(), Theme::new(Colours::Named, Glyphs::Braille))
    }

    pub fn with(settings: ConsoleSettings, theme: Theme) -> Console {
        let mut model = Model::new(settings, theme, RobotFacts::default());
        model.size = (80, 24);
        Console { model }
    }

    /// A session of the forward task on the simulator, robot disarmed, trial 0 proposed.
    pub fn proposed() -> Console {
        let mut console = Console::new();
        console.record(Record::Session(session()));
        console.record(Record::Proposal(proposal(0, 0)));
        console.stage(ExperimentStage::Proposed, 0);
        console.mode(Mode::Disarmed);
        console.record(Record::ArmingChecks(vec![ArmingCheckRecord {
            check: ArmingCheck::StateFresh,
            found: "0 ms old".into(),
            needed: "at most 10 ms".into(),
            state: ArmingCheckState::Passed,
        }]));
        console
    }

    /// [`Console::proposed`] with the robot in READY.
    pub fn ready() -> Console {
        let mut console = Console::proposed();
        console.mode(Mode::Ready);
        console
    }

    /// Trial 0 under review, the robot in `mode`.
    pub fn review(mode: Mode, suggested: Verdict) -> Console {
        let mut console = Console::ready();
        console.stage(ExperimentStage::Running, 0);
        console.record(Record::Trial(trial(0, None, Some(suggested))));
        console.stage(ExperimentStage::Review, 0);
        console.mode(mode);
        console
    }

    pub fn update(&mut self, msg: Msg) -> Vec<Effect> {
        update(&mut self.model, msg)
    }

    /// Time passes; the engine goes on.
    pub fn wait(&mut self, milliseconds: u64) {
        self.hang(milliseconds);
        let Tick { number, .. } = self.model.snapshot.tick;
        let tick = Tick { number: number + milliseconds, ..self.model.snapshot.tick };
        self.update(Msg::Snapshot(Box::new(Snapshot { tick, ..self.model.snapshot })));
    }

    /// Time passes without a new tick.
    pub fn hang(&mut self, milliseconds: u64) {
        let now = self.model.clock + Duration::from_millis(milliseconds);
        self.update(Msg::Clock(now));
        self.update(Msg::Snapshot(Box::new(self.model.snapshot)));
    }

    /// Presses keys by name, 0.1 s apart.
    pub fn press(&mut self, keys: &[&str]) -> Vec<Effect> {
        keys.iter()
            .flat_map(|name| {
                self.wait(100);
                let key: Key = name.parse().expect("a key's name");
                self.update(Msg::Key(key))
            })
            .collect()
    }

    pub fn record(&mut self, record: Record) -> Vec<Effect> {
        self.update(Msg::Record(Stamped { time_ns: self.model.snapshot.tick.time_ns, record }))
    }

    pub fn stage(&mut self, stage: ExperimentStage, trial: u32) -> Vec<Effect> {
        self.record(Record::Stage(StageRecord { stage, trial, can_undo: false, jumps: 0 }))
    }

    pub fn answer(&mut self, request: &str, accepted: bool, answer: &str) {
        self.record(Record::Request(RequestRecord { request: request.into(), accepted, answer: answer.into() }));
    }

    pub fn mode(&mut self, mode: Mode) {
        let from = self.model.mode();
        self.record(Record::Transition(Transition { from, to: mode, cause: "test".into() }));
        self.mode_of_ticks(mode);
    }

    /// The ticks say that the robot is in `mode`; the change was reported by itself.
    pub fn mode_of_ticks(&mut self, mode: Mode) {
        let tick = Tick { mode, ..self.model.snapshot.tick };
        self.update(Msg::Snapshot(Box::new(Snapshot { tick, ..self.model.snapshot })));
    }

    /// Presses keys; the requests to the session.
    pub fn requests(&mut self, keys: &[&str]) -> Vec<OperatorRequest> {
        requests(&self.press(keys))
    }

    /// Types a text, character by character.
    pub fn enter(&mut self, text: &str) {
        text.chars().for_each(|c| drop(self.press(&[&c.to_string()])));
    }

    /// A tick every 5 ms, outside of a trial, with the roll of each time in ms.
    pub fn ticks(&mut self, times_ms: Range<u64>, roll: impl Fn(u64) -> f64) {
        for time_ms in times_ms.step_by(5) {
            self.tick(tick(time_ms, roll(time_ms), None));
        }
    }

    /// A tick for the charts.
    pub fn tick(&mut self, tick: Tick) {
        self.update(Msg::Tick(Box::new(tick)));
    }

    /// Trials that are judged accept, fall, void in turn.
    pub fn judged(&mut self, count: u32) {
        for number in 0..count {
            self.record(Record::Trial(trial(number, Some(Verdict::ALL[number as usize % 3]), None)));
        }
    }

    pub fn draw(&self, columns: u16, rows: u16) -> Buffer {
        let mut terminal = Terminal::new(TestBackend::new(columns, rows)).expect("a screen in memory");
        terminal.draw(|frame| view::render(frame, &self.model)).expect("drawn");
        terminal.backend().buffer().clone()
    }

    /// The screen as text without trailing spaces.
    pub fn screen(&self, columns: u16, rows: u16) -> String {
        let buffer = self.draw(columns, rows);
        let mut text = String::new();
        for y in 0..rows {
            let line: String = (0..columns).map(|x| buffer[(x, y)].symbol()).collect();
            text.push_str(line.trim_end());
            text.push('\n');
        }
        text
    }

    /// The styles of the screen: a letter per cell, blank for the terminal's default style, and a legend of the letters.
    pub fn colours(&self, columns: u16, rows: u16) -> String {
        let buffer = self.draw(columns, rows);
        let colour = |colour: Color| match colour {
            Color::Rgb(r, g, b) => format!("{r},{g},{b}"),
            other => format!("{other:?}").to_lowercase(),
        };
        let mut styles: Vec<String> = Vec::new();
        let mut text = String::new();
        for y in 0..rows {
            let letters: String = (0..columns)
                .map(|x| {
                    let cell = &buffer[(x, y)];
                    // The foreground of a blank cell is invisible.
                    let plain = cell.bg == Color::Reset && cell.modifier.is_empty();
                    if plain && (cell.fg == Color::Reset || cell.symbol() == " ") {
                        return ' ';
                    }
                    let style = format!("{} on {} {:?}", colour(cell.fg), colour(cell.bg), cell.modifier);
                    let index = styles.iter().position(|known| *known == style).unwrap_or_else(|| {
                        styles.push(style);
                        styles.len() - 1
                    });
                    char::from(b'a' + u8::try_from(index).expect("few styles"))
                })
                .collect();
            text.push_str(letters.trim_end());
            text.push('\n');
        }
        for (index, style) in styles.iter().enumerate() {
            text.push_str(&format!("{}: {}\n", char::from(b'a' + index as u8), style.trim_end_matches(" NONE")));
        }
        text
    }

    /// The message to the operator.
    pub fn said(&self) -> &str {
        self.model.message.as_ref().map_or("", |message| message.text.as_str())
    }

    /// The text of the last line of the screen.
    pub fn next_step(&self) -> String {
        view::next_step::next_step(&self.model).lead
    }
}

pub fn requests(effects: &[Effect]) -> Vec<OperatorRequest> {
    let request = |effect: &Effect| match effect {
        Effect::Request(request) => Some(request.clone()),
        _ => None,
    };
    effects.iter().filter_map(request).collect()
}

pub fn line_with(screen: &str, text: &str) -> String {
    screen.lines().find(|line| line.contains(text)).unwrap_or_else(|| panic!("no {text} in\n{screen}")).to_owned()
}

#[track_caller]
pub fn assert_shows(screen: &str, parts: &[&str]) {
    for part in parts {
        assert!(screen.contains(part), "no {part}:\n{screen}");
    }
}

pub fn session() -> SessionInfo {
    let parameter =
        |name: &str, unit: &str, low, high| ParameterInfo { name: name.into(), unit: unit.into(), low, high };
    SessionInfo {
        version: "0.1.0".into(),
        backend: Some(Backend::Simulator),
        robot: "go1".into(),
        task: Some(Task::Forward),
        unit: "m".into(),
        sampler: Some(SamplerKind::Tpe),
        budget: 20,
        parameters: vec![
            parameter("f0", "Hz", 0.75, 1.75),
            parameter("Fx", "N", 0.0, 150.0),
            parameter("Fz", "N", 150.0, 350.0),
        ],
        study: "recordings/forward/study.log".into(),
        recording: "recordings/forward/session.mcap".into(),
        started: "2026-11-21T03:00:00Z".into(),
        gains: vec![
            parameter("kp", "N/m", 100.0, 1000.0),
            parameter("kd", "N s/m", 0.0, 30.0),
            parameter("kd_joint", "N m s/rad", 0.0, 3.0),
            parameter("k_att", "N/m", 0.0, 600.0),
        ],
        ..SessionInfo::default()
    }
}

pub fn proposal(trial: u32, revision: u32) -> Proposal {
    let parameter = |name: &str, value| ProposedParameter { name: name.into(), value, proposed: value };
    Proposal {
        trial,
        revision,
        source: ProposalSource::Sampler,
        parent: None,
        parameters: vec![parameter("f0", 1.25), parameter("Fx", 75.0), parameter("Fz", 250.0)],
        risk: None,
        expected: None,
        gains: vec![
            parameter("kp", 400.0),
            parameter("kd", 8.0),
            parameter("kd_joint", 0.8),
            parameter("k_att", 200.0),
        ],
        repeat: 0,
        repeats: 0,
    }
}

pub fn trial(number: u32, verdict: Option<Verdict>, suggested: Option<Verdict>) -> TrialRecord {
    let value = match verdict {
        Some(Verdict::Accept) => Some(0.4 + 0.01 * f64::from(number)),
        Some(Verdict::Fall) => Some(0.0),
        _ => None,
    };
    TrialRecord {
        trial: number,
        source: ProposalSource::Sampler,
        parent: None,
        parameters: vec![("f0".into(), 1.25), ("Fx".into(), 75.0), ("Fz".into(), 250.0)].into(),
        measured: Some(MeasuredJump {
            dx_m: 0.42,
            dy_m: -0.01,
            dyaw_rad: 0.02,
            apex_m: 0.3,
            air_s: 0.25,
            ..MeasuredJump::default()
        }),
        value,
        hand_value: None,
        suggested,
        cause: if suggested == Some(Verdict::Fall) { "roll 1.200 rad exceeds 1.000 rad" } else { "landed and settled" }
            .into(),
        verdict,
        judged_by: None,
        note: String::new(),
        risk: None,
        expected: None,
        gains: Vec::new().into(),
        repeats: Vec::new(),
        seed: None,
        ranges: Vec::new(),
        proposed: Vec::new().into(),
    }
}

/// A tick for the charts at a time.
pub fn tick(time_ms: u64, roll: f64, trial: Option<(u32, f64, Phase)>) -> Tick {
    let mut tick = Tick { number: time_ms, time_ns: time_ms * 1_000_000, mode: Mode::Ready, ..Tick::default() };
    tick.estimate.roll_pitch_yaw.x = roll;
    for foot in &mut tick.estimate.foot_position_leg {
        foot.z = -0.2;
    }
    if let Some((number, time_s, phase)) = trial {
        tick.trial = Some(number);
        tick.trial_time_s = time_s;
        tick.phase = phase;
        tick.estimate.contact = [phase != Phase::Flight; 4];
    }
    tick
}
