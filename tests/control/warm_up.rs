//! A cache warm-up changes no tick, event or datagram.

use crate::bench;
use crate::go1;
use bench::{shipped, spec};
use go1::pair;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::realtime::channel::channels;
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::realtime::thread::TickStart;
use quadfrog::robot::{LinkStatus, Robot};
use quadfrog::sim::emulator::{EmulatorFault, EmulatorStatus};
use quadfrog::telemetry::{Command, Event, Mode, Permit, Tick};
use quadfrog::trial::Backend;

/// Regression: one tick of five is shown, and the history of the lateness missed the worst of the others.
#[test]
fn the_console_reads_the_largest_lateness_of_every_tick() {
    let (config, _, settings) = shipped(Backend::Hardware);
    let (_, mut robot) = pair(&config.simulator, 1);
    let (control, _session, mut screen, _recorder) = channels();
    let mut body = ControlLoop::new(&settings, control);
    let mut read_after = |last_ms: u64, late_ms: u64| {
        for ms in last_ms - 20..=last_ms {
            let lateness_ns = if ms == late_ms { 17_600_000 } else { 1000 };
            body.tick(TickStart { planned_ns: ms * 1_000_000, lateness_ns }, &SimulatedClock, &mut robot);
        }
        screen.snapshot.read().lateness
    };
    let first = read_after(900, 887);
    assert_eq!((first.present_ns, first.before_ns), (17_600_000, 0));
    let second = read_after(first.second * 1000 + 1500, 0);
    assert_eq!((second.second, second.present_ns, second.before_ns), (first.second + 1, 1000, 17_600_000));
    let later = read_after(first.second * 1000 + 4500, 0);
    assert_eq!((later.present_ns, later.before_ns), (1000, 0));
}

/// Over the link to an emulated robot on a bad network: taken over, armed, one jump and its review, a STOP, a restart.
fn session(warm_up: bool) -> (Vec<Tick>, Vec<Event>, LinkStatus, EmulatorStatus) {
    let (config, _, settings) = shipped(Backend::Hardware);
    let (mut emulator, mut robot) = pair(&config.simulator, 1);
    let (control, mut session, screen, mut recorder) = channels();
    let mut body = ControlLoop::new(&settings, control);
    let (mut ticks, mut events) = (Vec::new(), Vec::new());
    for ms in 0..20_000 {
        screen.heartbeat.beat();
        let permit = Permit {
            mode_changes: events.iter().filter(|event| matches!(event, Event::Mode { .. })).count() as u64,
            given_ns: ms * 1_000_000,
        };
        let command = match body.mode() {
            Mode::Observe if ms == 100 => Some(Command::TakeControl),
            Mode::Disarmed if ms == 2000 => Some(Command::Arm(permit)),
            Mode::Ready if ms == 5000 => Some(Command::RunTrial(spec(&config), permit)),
            _ => None,
        };
        if let Some(command) = command {
            session.commands.push(command).unwrap();
        }
        match ms {
            1000 => emulator.apply("jitter 2".parse().unwrap()),
            // Arming and jump would be refused with such a network; it can degrade later.
            8500 => emulator.apply("loss 2".parse().unwrap()),
            8501 => emulator.apply("duplicate 2".parse().unwrap()),
            16_000 => session.stop.set(),
            16_500 => emulator.apply("corrupt 5".parse().unwrap()),
            17_000 => emulator.apply(EmulatorFault::Reboot),
            _ => {}
        }
        if warm_up {
            body.warm_up(&SimulatedClock, &mut robot);
        }
        let instant = TickStart { planned_ns: ms * 1_000_000, lateness_ns: 0 };
        ticks.push(*body.tick(instant, &SimulatedClock, &mut robot));
        body.prepare();
        let _ = recorder.pop();
        events.extend(std::iter::from_fn(|| session.events.pop().ok()));
        emulator.step();
    }
    // Each session has a port of its own.
    (ticks, events, robot.link().unwrap(), EmulatorStatus { client: None, ..*emulator.status() })
}

#[test]
fn a_warm_up_changes_nothing() {
    let (ticks, events, link, emulator) = session(true);
    let (ticks_without, events_without, link_without, emulator_without) = session(false);
    for mode in [Mode::Observe, Mode::StandUp, Mode::Ready, Mode::Jump, Mode::Settle, Mode::Review, Mode::Damped] {
        assert!(ticks.iter().any(|tick| tick.mode == mode), "never {mode:?}");
    }
    let differs = ticks.iter().zip(&ticks_without).find(|(with, without)| with != without);
    assert!(differs.is_none(), "{differs:?}");
    assert_eq!(events, events_without);
    assert_eq!(link, link_without);
    assert_eq!(emulator, emulator_without);
    assert!(link.sent > 15_000 && link.received > 12_000 && link.lost > 100 && link.reboots == 1, "{link:?}");
}
