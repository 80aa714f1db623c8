//! The control loop allocates and frees nothing: whole trials, STOP, faults, falls and every mode under an allocator that aborts,
//! with the simulator and with a robot over a link.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "support/no_alloc.rs"]
mod no_alloc;
#[path = "support/robots.rs"]
mod robots;

use std::collections::BTreeSet;

use no_alloc::without_allocation;
use quadfrog::config::Config;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::control::settings::ControlSettings;
use quadfrog::realtime::channel::{ControlEnd, ScreenEnd, SessionEnd, channels};
use quadfrog::realtime::clock::MonotonicClock;
use quadfrog::realtime::thread::TickStart;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{Placement, Robot, RobotState};
use quadfrog::telemetry::{Command, Event, Mode, Permit, Tick};
use quadfrog::trial::{Backend, JumpParameters, Task};
use robots::LinkedRobot;

struct Bench {
    config: Config,
    settings: ControlSettings,
    body: ControlLoop,
    session: SessionEnd,
    screen: ScreenEnd,
    recorder: rtrb::Consumer<Tick>,
    machine: LinkedRobot,
    clock: MonotonicClock,
    time_ms: u64,
    mode_changes: u64,
    seen: BTreeSet<&'static str>,
    beats: bool,
}

impl Bench {
    fn new(backend: Backend) -> Bench {
        let config = Config::load(None).unwrap();
        let description = RobotDescription::embedded("go1").unwrap();
        let settings = config.settings(&description, Task::Forward, backend).unwrap();
        let (control, session, screen, recorder): (ControlEnd, _, _, _) = channels();
        let lying = LinkedRobot::lying(&description, &config.simulator);
        let machine = LinkedRobot { linked: backend == Backend::Hardware, ..lying };
        Bench {
            config,
            settings,
            body: ControlLoop::new(&settings, control),
            session,
            screen,
            recorder,
            machine,
            clock: MonotonicClock::start(),
            time_ms: 0,
            mode_changes: 0,
            seen: BTreeSet::new(),
            beats: true,
        }
    }

    fn ticks(&mut self, count: u32) {
        for _ in 0..count {
            if self.beats {
                self.screen.heartbeat.beat();
            }
            let instant = TickStart { planned_ns: self.time_ms * 1_000_000, lateness_ns: 0 };
            let Bench { body, machine, clock, .. } = self;
            let mode = without_allocation(|| {
                body.warm_up(clock, machine);
                let mode = body.tick(instant, clock, machine).mode;
                body.prepare();
                mode
            });
            self.time_ms += 1;
            self.seen.insert(mode.name());
            while let Ok(event) = self.session.events.pop() {
                self.mode_changes += u64::from(matches!(event, Event::Mode { .. }));
            }
            // Every other tick is taken, so that the ring runs full: that must not allocate either.
            if self.time_ms.is_multiple_of(2) {
                let _ = self.recorder.pop();
            }
        }
    }

    fn command(&mut self, command: Command) {
        self.session.commands.push(command).unwrap();
        self.ticks(1);
    }

    fn until(&mut self, mode: Mode) {
        for _ in 0..20_000 {
            if self.body.mode() == mode {
                return;
            }
            self.ticks(1);
        }
        panic!("never {mode:?}; last {:?}", self.body.mode());
    }

    fn arm(&mut self) {
        let permit = Permit { mode_changes: self.mode_changes, given_ns: self.time_ms * 1_000_000 };
        self.command(Command::Arm(permit));
    }

    fn approve(&mut self, fx_n: f64, f0_hz: f64) {
        let jump = JumpParameters { f0_hz, f1_hz: 0.0, fx_n, fy_n: 0.0, fz_n: 220.0 };
        let spec = self.config.task(Task::Forward).trial(Task::Forward, jump);
        let permit = Permit { mode_changes: self.mode_changes, given_ns: self.time_ms * 1_000_000 };
        self.command(Command::RunTrial(spec, permit));
    }

    fn recover(&mut self) {
        let stops = self.session.stop.count();
        self.command(Command::Acknowledge { stops });
        assert_eq!(self.body.mode(), Mode::Disarmed);
        // A real robot is folded by hand; a simulated one is placed.
        let lying = Placement { joint_position: self.settings.lying_position, lying: true, seed: 0 };
        self.machine.simulator.place(&lying);
        self.ticks(1);
        if self.body.mode() == Mode::Fault {
            self.command(Command::Acknowledge { stops });
        }
        self.ticks(1500);
    }

    fn stand(&mut self) {
        self.arm();
        assert_eq!(self.body.mode(), Mode::StandUp);
        self.until(Mode::Ready);
    }
}

/// All modes, a good trial, a fall, STOP, every kind of fault, a lost operator, refused commands.
fn everything(backend: Backend) {
    let mut bench = Bench::new(backend);
    bench.ticks(1);
    bench.ticks(5);
    bench.command(Command::TakeControl);
    if backend == Backend::Hardware {
        // Refused: the gyroscope has not been still for a second yet.
        bench.arm();
        assert_eq!(bench.body.mode(), Mode::Disarmed);
    }
    bench.ticks(1500);
    bench.stand();
    bench.approve(60.0, 1.3);
    bench.until(Mode::Review);
    bench.command(Command::EndReview);
    bench.arm();
    bench.command(Command::SitDown);
    bench.until(Mode::Disarmed);
    bench.ticks(1500);

    bench.stand();
    bench.approve(150.0, 0.8);
    bench.until(Mode::Damped);
    bench.ticks(2000);
    bench.recover();

    bench.stand();
    bench.screen.stop.set();
    bench.ticks(1000);
    assert_eq!(bench.body.mode(), Mode::Damped);
    bench.recover();

    let tampers: [fn(&mut RobotState); 4] = [
        |state| state.joint_velocity[3] = f64::NAN,
        |state| state.motor_enabled[3] = false,
        |state| state.joint_position[3] = 2.0,
        |state| state.motor_temperature_c[3] = 90.0,
    ];
    for tamper in tampers {
        bench.stand();
        bench.machine.tamper = tamper;
        bench.ticks(300);
        assert_eq!(bench.body.mode(), Mode::Fault);
        bench.machine.tamper = |_| {};
        bench.ticks(1500);
        bench.recover();
    }
    bench.stand();
    bench.machine.silent_ms = 30;
    bench.ticks(300);
    bench.machine.silent_ms = 0;
    bench.ticks(10);
    bench.recover();
    bench.machine.send_errno = Some(111);
    bench.ticks(10);
    assert_eq!(bench.body.mode(), Mode::Fault);
    bench.machine.send_errno = None;
    bench.ticks(10);
    bench.recover();

    bench.stand();
    bench.beats = false;
    bench.until(Mode::Disarmed);
    bench.command(Command::Leave);
    let all: BTreeSet<_> = Mode::ALL.iter().map(|mode| mode.name()).filter(|name| *name != "OFFLINE").collect();
    assert_eq!(bench.seen, all);
}

#[test]
fn the_body_with_the_simulator_never_allocates() {
    everything(Backend::Simulator);
}

#[test]
fn the_body_with_a_linked_robot_never_allocates() {
    everything(Backend::Hardware);
}
