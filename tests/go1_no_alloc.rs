//! The Go1's link never allocates in `read` and `write`: an allocator that aborts the process is active during a jump
//! and thousands of ticks over good, bad, silent and dead networks.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "support/go1.rs"]
mod go1;
#[path = "support/no_alloc.rs"]
mod no_alloc;

use std::collections::BTreeSet;
use std::net::UdpSocket;

use go1::{ANY_PORT, description, network, pair};
use no_alloc::without_allocation;
use quadfrog::config::Config;
use quadfrog::control::control_loop::ControlLoop;
use quadfrog::realtime::channel::channels;
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::realtime::thread::TickStart;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{JointCommand, Robot};
use quadfrog::sim::emulator::EmulatorFault;
use quadfrog::telemetry::{Command, Event, Mode, Permit};
use quadfrog::trial::{Backend, JumpParameters, Task};

/// The control thread's body over the link: standing up, a jump and its review on a good network; then a network that
/// loses, duplicates, corrupts and delays, and a restart: every branch of the link.
#[test]
fn a_tick_over_the_link_does_not_allocate() {
    let config = Config::load(None).unwrap();
    let (mut emulator, mut go1) = pair(&config.simulator, 1);
    let settings = config.settings(&description(), Task::Forward, Backend::Hardware).unwrap();
    let (control, mut session, screen, mut recorder) = channels();
    let mut body = ControlLoop::new(&settings, control);
    let (mut ms, mut mode_changes, mut seen) = (0, 0, BTreeSet::new());
    let mut ticks = |count: u32, until: Option<Mode>, command: Option<fn(Permit, &Config) -> Command>| {
        if let Some(command) = command {
            let permit = Permit { mode_changes, given_ns: ms * 1_000_000 };
            session.commands.push(command(permit, &config)).unwrap();
        }
        for _ in 0..count {
            screen.heartbeat.beat();
            let instant = TickStart { planned_ns: ms * 1_000_000, lateness_ns: 0 };
            let mode = without_allocation(|| {
                body.warm_up(&SimulatedClock, &mut go1);
                let mode = body.tick(instant, &SimulatedClock, &mut go1).mode;
                body.prepare();
                mode
            });
            ms += 1;
            seen.insert(mode.name());
            while let Ok(event) = session.events.pop() {
                mode_changes += u64::from(matches!(event, Event::Mode { .. }));
            }
            let _ = recorder.pop();
            emulator.step();
            if until == Some(mode) {
                return;
            }
            if ms == 20_000 {
                for fault in ["loss 5", "duplicate 5", "corrupt 5", "jitter 3"] {
                    emulator.apply(fault.parse().unwrap());
                }
            } else if ms == 23_000 {
                emulator.apply(EmulatorFault::Reboot);
            }
        }
        assert_eq!(until, None, "never reached after {count} ticks");
    };
    ticks(100, Some(Mode::Observe), None);
    ticks(1500, None, Some(|_, _| Command::TakeControl));
    ticks(3000, Some(Mode::Ready), Some(|permit, _| Command::Arm(permit)));
    ticks(
        12_000,
        Some(Mode::Review),
        Some(|permit, config| {
            let jump = JumpParameters { f0_hz: 1.3, f1_hz: 0.0, fx_n: 60.0, fy_n: 0.0, fz_n: 270.0 };
            Command::RunTrial(config.task(Task::Forward).trial(Task::Forward, jump), permit)
        }),
    );
    ticks(26_000, None, None);
    for mode in [Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump, Mode::Settle, Mode::Review, Mode::Fault] {
        assert!(seen.contains(mode.name()), "{mode:?} is not among {seen:?}");
    }
    let link = go1.link().unwrap();
    assert!(link.corrupt > 50 && link.duplicate > 50 && link.lost > 50 && link.late > 50, "{link:?}");
    assert_eq!(link.reboots, 1);
}

#[test]
fn a_dead_port_and_a_flood_do_not_make_it_allocate() {
    let socket = UdpSocket::bind(ANY_PORT).unwrap();
    let address = socket.local_addr().unwrap();
    let mut go1 = Go1::open(&network(address), false).unwrap();
    socket.connect(("127.0.0.1", go1.local_address().unwrap().port())).unwrap();
    for _ in 0..60 {
        socket.send(&[0; 900]).unwrap();
    }
    without_allocation(|| {
        for _ in 0..10 {
            let _ = go1.read();
        }
    });
    assert_eq!(go1.link().unwrap().foreign, 60);
    drop(socket);
    without_allocation(|| {
        for _ in 0..1000 {
            let _ = go1.write(&JointCommand::damping(3.0));
            let _ = go1.read();
        }
    });
}
