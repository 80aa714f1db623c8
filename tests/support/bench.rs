//! The control cycle, or the control loop with its channels, on a robot of the test, with an operator's commands.
#![allow(dead_code, reason = "each test uses its own part")]

use quadfrog::config::Config;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::control::cycle::{Cycle, TickInputs};
use quadfrog::control::settings::ControlSettings;
use quadfrog::realtime::channel::{ConsolePorts, SessionPorts, channels};
use quadfrog::realtime::clock::{Clock, MonotonicClock, SimulatedClock};
use quadfrog::realtime::thread::TickStart;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, LEGS, Robot};
use quadfrog::telemetry::{
    Command, CommandRefusal, Event, Fault, Mode, Permit, Tick, TransitionCause, TrialEnd, TrialSpec,
};
use quadfrog::trial::{Backend, JumpParameters, Task};

/// The shipped configuration, the Go1, and its settings for a forward jump.
pub fn shipped(backend: Backend) -> (Config, RobotDescription, ControlSettings) {
    let config = Config::load(None).unwrap();
    let description = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&description, Task::Forward, backend).unwrap();
    (config, description, settings)
}

/// A forward jump that lands, number 3.
pub fn spec(config: &Config) -> TrialSpec {
    let jump = JumpParameters { f0_hz: 1.3, f1_hz: 0.0, fx_n: 60.0, fy_n: 0.0, fz_n: 270.0 };
    TrialSpec { trial: 3, ..config.task(Task::Forward).trial(Task::Forward, jump) }
}

fn mode_changes(events: &[Event]) -> u64 {
    events.iter().filter(|event| matches!(event, Event::Mode { .. })).count() as u64
}

/// A control cycle with its robot, tick by tick.
pub struct Bench<R> {
    pub config: Config,
    pub settings: ControlSettings,
    pub cycle: Cycle,
    pub robot: R,
    /// Inputs of the next tick, but for its command.
    pub inputs: TickInputs,
    pub period_ns: u64,
    pub events: Vec<Event>,
    pub mode_changes: u64,
    /// Ticks of trials.
    pub trial_ticks: u64,
    /// Called after each tick.
    pub after_tick: fn(&mut R),
}

impl<R: Robot> Bench<R> {
    pub fn new(config: Config, settings: ControlSettings, robot: R) -> Bench<R> {
        Bench {
            config,
            settings,
            cycle: Cycle::new(&settings),
            robot,
            inputs: TickInputs::default(),
            period_ns: 1_000_000,
            events: Vec::new(),
            mode_changes: 0,
            trial_ticks: 0,
            after_tick: |_| {},
        }
    }

    pub fn tick(&mut self, command: Option<Command>) -> Tick {
        self.inputs.time_ns += self.period_ns;
        let inputs = TickInputs { command, ..self.inputs };
        let tick = *self.cycle.tick(&inputs, &SimulatedClock, &mut self.robot);
        let new: Vec<Event> = self.cycle.events().iter().collect();
        self.mode_changes += mode_changes(&new);
        self.events.extend(new);
        self.trial_ticks += u64::from(tick.trial.is_some());
        (self.after_tick)(&mut self.robot);
        tick
    }

    pub fn command(&mut self, command: Command) -> Tick {
        self.tick(Some(command))
    }

    /// One tick with STOP set.
    pub fn stop(&mut self, command: Option<Command>) -> Tick {
        self.inputs.stop = true;
        let tick = self.tick(command);
        self.inputs.stop = false;
        tick
    }

    pub fn ticks(&mut self, count: u32) {
        for _ in 0..count {
            self.tick(None);
        }
    }

    /// Ticks without a command until `mode`; returns the last one.
    pub fn until(&mut self, mode: Mode) -> Tick {
        for _ in 0..20_000 {
            if self.cycle.mode() == mode {
                return *self.cycle.last();
            }
            self.tick(None);
        }
        panic!("never {mode:?}; last {:?}: {:?}", self.cycle.mode(), self.events.last());
    }

    /// Ticks until another mode, at most `most`; returns their number.
    pub fn ticks_in_mode(&mut self, mode: Mode, most: u32) -> u32 {
        for n in 1..=most {
            if self.tick(None).mode != mode {
                return n;
            }
        }
        panic!("still {mode:?} after {most} ms: {:?}", self.events.last());
    }

    /// Ticks until `mode`; returns the modes on the way.
    pub fn modes_until(&mut self, mode: Mode) -> Vec<Mode> {
        let mut modes = vec![self.cycle.mode()];
        while *modes.last().unwrap() != mode && self.cycle.last().number < 60_000 {
            let now = self.tick(None).mode;
            if *modes.last().unwrap() != now {
                modes.push(now);
            }
        }
        modes
    }

    /// A permit given now, with every change of mode counted.
    pub fn permit(&self) -> Permit {
        Permit { mode_changes: self.mode_changes, given_ns: self.inputs.time_ns }
    }

    pub fn spec(&self) -> TrialSpec {
        spec(&self.config)
    }

    pub fn approved(&self) -> Command {
        Command::RunTrial(self.spec(), self.permit())
    }

    /// Waits in READY, on hardware, until the robot is ready for a jump: still, and a second after the last disturbance.
    pub fn settle(&mut self) {
        if self.settings.hardware {
            self.ticks(1200);
        }
    }

    pub fn arm(&self) -> Command {
        Command::Arm(self.permit())
    }

    /// Brings the robot into `mode` with an operator's commands.
    pub fn reach(mut self, mode: Mode) -> Bench<R> {
        use Mode::*;
        if mode == Offline {
            return self;
        }
        for step in [Observe, Disarmed, StandUp, Ready, Countdown, Jump, Settle, Review, SitDown] {
            match step {
                Disarmed => {
                    self.command(Command::TakeControl);
                    if self.settings.hardware {
                        // The arming checks need a second without motion and with ticks on time.
                        self.ticks(1500);
                    }
                }
                StandUp => drop(self.command(self.arm())),
                Countdown => {
                    self.settle();
                    self.command(self.approved());
                }
                SitDown => drop(self.command(Command::SitDown)),
                _ => drop(self.until(step)),
            }
            assert_eq!(self.cycle.mode(), step, "{:?}", self.cycle.readiness());
            if step == mode {
                return self;
            }
        }
        self.stop(None);
        if mode == Fault {
            self.inputs.events_lost = true;
            self.tick(None);
            self.inputs.events_lost = false;
        }
        assert_eq!(self.cycle.mode(), mode);
        self
    }

    /// Brings the robot into the flight of a jump.
    pub fn airborne(self) -> Bench<R> {
        let mut bench = self.reach(Mode::Jump);
        for _ in 0..2000 {
            if bench.tick(None).estimate.contact == [false; LEGS] {
                bench.ticks(20);
                assert_eq!(bench.cycle.last().estimate.contact, [false; LEGS]);
                return bench;
            }
        }
        panic!("it never flew");
    }

    /// Whether a tick damps every joint with the configured gain.
    pub fn damps(&self, tick: &Tick) -> bool {
        tick.command == JointCommand::damping(self.settings.gate.damping_kd)
    }

    /// The faults that were reported.
    pub fn faults(&self) -> Vec<Fault> {
        let fault = |event: &Event| match event {
            Event::Mode { to: Mode::Fault, cause: TransitionCause::Fault(fault), .. } => Some(*fault),
            _ => None,
        };
        self.events.iter().filter_map(fault).collect()
    }

    /// The ends of the trials that were reported.
    pub fn ends(&self) -> Vec<TrialEnd> {
        let end = |event: &Event| match event {
            Event::TrialEnded { end, .. } => Some(*end),
            _ => None,
        };
        self.events.iter().filter_map(end).collect()
    }

    /// The refusal of a command in the last tick.
    pub fn refusal(&self) -> Option<CommandRefusal> {
        self.cycle.events().iter().find_map(|event| match event {
            Event::Refused { because, .. } => Some(because),
            _ => None,
        })
    }
}

/// The machine's clock for ticks that are not paced: the robot's clock is compared with their planned time.
struct UnpacedClock(MonotonicClock);

impl Clock for UnpacedClock {
    fn now_ns(&self) -> u64 {
        self.0.now_ns()
    }
    fn suspended_ns(&self) -> Option<[u64; 2]> {
        self.0.suspended_ns()
    }
}

/// A control loop with its channels and its robot.
pub struct LoopBench<R> {
    pub config: Config,
    pub body: ControlLoop,
    pub session: SessionPorts,
    pub screen: ConsolePorts,
    pub recorder: rtrb::Consumer<Tick>,
    pub robot: R,
    clock: UnpacedClock,
    pub time_ms: u64,
    mode_changes: u64,
    pub seen: std::collections::BTreeSet<&'static str>,
    /// Whether the operator's console sends heartbeats.
    pub beats: bool,
    /// Calls the body of a tick.
    guard: fn(&mut dyn FnMut()),
}

impl<R: Robot> LoopBench<R> {
    pub fn new(config: Config, settings: &ControlSettings, robot: R, guard: fn(&mut dyn FnMut())) -> LoopBench<R> {
        let (control, session, screen, recorder) = channels();
        LoopBench {
            config,
            body: ControlLoop::new(settings, control),
            session,
            screen,
            recorder,
            robot,
            clock: UnpacedClock(MonotonicClock::start()),
            time_ms: 0,
            mode_changes: 0,
            seen: Default::default(),
            beats: true,
            guard,
        }
    }

    pub fn tick(&mut self) {
        if self.beats {
            self.screen.heartbeat.beat();
        }
        let start = TickStart { planned_ns: self.time_ms * 1_000_000, lateness_ns: 0 };
        let LoopBench { body, robot, clock, .. } = self;
        (self.guard)(&mut || {
            body.warm_up(clock, robot);
            body.tick(start, clock, robot);
            body.prepare();
        });
        self.time_ms += 1;
        self.seen.insert(self.body.mode().name());
        while let Ok(event) = self.session.events.pop() {
            self.mode_changes += mode_changes(&[event]);
        }
        // Every other tick is taken, so that the ring runs full.
        if self.time_ms.is_multiple_of(2) {
            let _ = self.recorder.pop();
        }
    }

    pub fn ticks(&mut self, count: u32) {
        for _ in 0..count {
            self.tick();
        }
    }

    pub fn command(&mut self, command: Command) {
        self.session.commands.push(command).unwrap();
        self.tick();
    }

    pub fn until(&mut self, mode: Mode) {
        for _ in 0..20_000 {
            if self.body.mode() == mode {
                return;
            }
            self.tick();
        }
        panic!("never {mode:?}; last {:?}", self.body.mode());
    }

    pub fn permit(&self) -> Permit {
        Permit { mode_changes: self.mode_changes, given_ns: self.time_ms * 1_000_000 }
    }

    pub fn stand(&mut self) {
        self.command(Command::Arm(self.permit()));
        assert_eq!(self.body.mode(), Mode::StandUp);
        self.until(Mode::Ready);
    }
}
