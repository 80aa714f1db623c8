//! The Go1's link never allocates in `read` and `write`: an allocator that aborts the process is active during a jump
//! and thousands of ticks over good, bad, silent and dead networks.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "support/bench.rs"]
mod bench;
#[path = "support/go1.rs"]
mod go1;
#[path = "support/no_alloc.rs"]
mod no_alloc;

use std::net::UdpSocket;

use bench::{LoopBench, shipped, spec};
use go1::{ANY_PORT, network, pair};
use no_alloc::without_allocation;
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{JointCommand, Robot};
use quadfrog::sim::emulator::{Emulator, EmulatorFault};
use quadfrog::telemetry::{Command, Mode};
use quadfrog::trial::Backend;

fn run(bench: &mut LoopBench<Go1>, emulator: &mut Emulator, count: u32) {
    for _ in 0..count {
        bench.tick();
        emulator.step();
    }
}

/// The control thread's body over the link: standing up, a jump and its review on a good network; then a network that
/// loses, duplicates, corrupts and delays, and a restart: every branch of the link.
#[test]
fn a_tick_over_the_link_does_not_allocate() {
    let (config, _, settings) = shipped(Backend::Hardware);
    let (mut emulator, go1) = pair(&config.simulator, 1);
    let mut bench = LoopBench::new(config, &settings, go1, |tick| without_allocation(tick));
    run(&mut bench, &mut emulator, 100);
    bench.command(Command::TakeControl);
    run(&mut bench, &mut emulator, 1500);
    bench.command(Command::Arm(bench.permit()));
    run(&mut bench, &mut emulator, 4000);
    bench.command(Command::RunTrial(spec(&bench.config), bench.permit()));
    run(&mut bench, &mut emulator, 12_000);
    assert!(bench.seen.contains(Mode::Review.name()), "{:?}", bench.seen);
    for fault in ["loss 5", "duplicate 5", "corrupt 5", "jitter 3"] {
        emulator.apply(fault.parse().unwrap());
    }
    run(&mut bench, &mut emulator, 3000);
    emulator.apply(EmulatorFault::Reboot);
    run(&mut bench, &mut emulator, 23_000);
    for mode in [Mode::StandUp, Mode::Ready, Mode::Countdown, Mode::Jump, Mode::Settle, Mode::Review, Mode::Fault] {
        assert!(bench.seen.contains(mode.name()), "{mode:?} is not among {:?}", bench.seen);
    }
    let link = bench.robot.link().unwrap();
    assert!(link.corrupt > 50 && link.duplicate > 50 && link.lost > 50 && link.out_of_order > 50, "{link:?}");
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
