//! No step allocates: a counting allocator during a jump-like run on every terrain with all sensor and motor errors.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, Placement, Robot};
use quadfrog::sim::{ActuatorKind, SimConfig, Simulator, TerrainKind};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call goes unchanged to the system's allocator; counting touches only a thread-local number.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's guarantees are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's guarantees are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

#[test]
fn the_counter_counts() {
    let before = allocations();
    let kept = std::hint::black_box(vec![1.0; 100]);
    assert!(allocations() > before);
    drop(kept);
}

#[test]
fn a_step_does_not_allocate() {
    let robot = RobotDescription::embedded("go1").unwrap();
    for kind in [TerrainKind::Flat, TerrainKind::Slope, TerrainKind::Steps, TerrainKind::Blocks] {
        for actuator in [ActuatorKind::Ideal, ActuatorKind::HardwareLike] {
            let mut config = SimConfig::default();
            config.terrain.kind = kind;
            config.terrain.blocks.loose = true;
            config.actuator.kind = actuator;
            config.sensors.enabled = true;
            config.sensors.delay_ms = 3;
            let mut simulator = Simulator::new(&robot, &config).unwrap();
            let joint_position = robot.lying_position;
            simulator.place(&Placement { joint_position, lying: true, seed: 5 });
            let before = allocations();
            // Random motion, jumps and falls: every kind of step, with many contacts.
            for tick in 0..3000 {
                let t = f64::from(tick) * 0.001;
                let command = JointCommand::torques(&std::array::from_fn(|i| 25.0 * (7.0 * t + i as f64).sin()));
                simulator.write(&command).unwrap();
                let state = simulator.read().unwrap();
                assert!(state.joint_position[0].is_finite());
            }
            assert_eq!(allocations() - before, 0, "{kind:?}, {actuator:?}");
        }
    }
}
