//! Nothing allocates when the Go1's link reads and writes, whatever comes: a counting allocator watches thousands of ticks over
//! good, bad, silent and dead networks.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "support/go1.rs"]
mod go1;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::net::UdpSocket;

use go1::{ANY_PORT, description, pair};
use quadfrog::config::{Backend, Config};
use quadfrog::control::cycle::{Cycle, Inputs};
use quadfrog::realtime::clock::SimulatedClock;
use quadfrog::realtime::command::{Command, Permit, Task};
use quadfrog::robot::go1::Go1;
use quadfrog::robot::{JointCommand, Robot};
use quadfrog::sim::emulator::Fault;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes unchanged to the system's allocator; counting touches only a thread-local number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// How often `work` allocates.
fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    work();
    ALLOCATIONS.with(Cell::get) - before
}

#[test]
fn the_counter_counts() {
    assert!(allocations(|| drop(std::hint::black_box(vec![1.0; 100]))) > 0);
}

/// Standing up over a network that loses, doubles, spoils and delays, then a restart: every branch of the link.
#[test]
fn a_tick_over_the_link_does_not_allocate() {
    let config = Config::load(None).unwrap();
    let (mut emulator, mut go1) = pair(&config.simulator, 1);
    let settings = config.settings(&description(ANY_PORT), Task::Forward, Backend::Hardware).unwrap();
    let mut cycle = Cycle::new(&settings);
    let mut total = 0;
    for ms in 0..6000 {
        if ms == 1000 {
            for fault in ["loss 5", "duplicate 5", "corrupt 5", "jitter 3"] {
                emulator.apply(fault.parse().unwrap());
            }
        } else if ms == 4000 {
            emulator.apply(Fault::Reboot);
        }
        let command = match ms {
            20 => Some(Command::TakeControl),
            // Two changes: heard, and taken control of.
            100 => Some(Command::Arm(Permit { mode_changes: 2, given_ns: ms * 1_000_000 })),
            _ => None,
        };
        let inputs = Inputs { command, time_ns: ms * 1_000_000, ..Inputs::default() };
        total += allocations(|| {
            let _ = cycle.tick(&inputs, &SimulatedClock, &mut go1);
        });
        emulator.step();
    }
    let link = go1.link().unwrap();
    assert!(link.corrupt > 50 && link.duplicate > 50 && link.lost > 50 && link.late > 50, "{link:?}");
    assert_eq!(total, 0);
}

#[test]
fn a_dead_port_and_a_flood_do_not_make_it_allocate() {
    let socket = UdpSocket::bind(ANY_PORT).unwrap();
    let address = socket.local_addr().unwrap();
    let mut go1 = Go1::open(&description(address), false).unwrap();
    socket.connect(("127.0.0.1", go1.local_address().unwrap().port())).unwrap();
    for _ in 0..60 {
        socket.send(&[0; 900]).unwrap();
    }
    let flood = allocations(|| {
        for _ in 0..10 {
            let _ = go1.read();
        }
    });
    assert_eq!(go1.link().unwrap().foreign, 60);
    drop(socket);
    let dead = allocations(|| {
        for _ in 0..1000 {
            let _ = go1.write(&JointCommand::damping(3.0));
            let _ = go1.read();
        }
    });
    assert_eq!((flood, dead), (0, 0));
}
