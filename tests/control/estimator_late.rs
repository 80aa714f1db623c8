//! The estimate of the base with timing gaps and lost states: over whole jumps, compared with the true state of the
//! emulated robot.

use crate::estimation;
use crate::go1;
use estimation::{JumpError, World, jumps_on, percentile};
use go1::{Late, Lockstep};
use quadfrog::control::settings::ObjectiveSource;
use quadfrog::robot::{JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::SimConfig;
use quadfrog::sim::emulator::EmulatorFault;
use quadfrog::telemetry::TrialEnd;

/// An emulated robot that does not report contact of its belly, like a real one, and whose network gets faults when it
/// stands.
struct WithoutBodyContact {
    robot: Lockstep,
    faults: Vec<EmulatorFault>,
    elapsed_ms: u32,
}

impl Robot for WithoutBodyContact {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        let mut state = self.robot.read()?;
        if let Some(truth) = &mut state.truth {
            truth.body_contact = false;
        }
        Ok(state)
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.elapsed_ms += 1;
        if self.elapsed_ms == 500 {
            self.faults.iter().for_each(|fault| self.robot.emulator.apply(*fault));
        }
        self.robot.write(command)
    }
    fn place(&mut self, placement: &Placement) -> bool {
        self.robot.place(placement)
    }
    fn link(&self) -> Option<LinkStatus> {
        self.robot.link()
    }
}

/// Makes whole jumps with timing gaps and network faults.
fn jumps(config: &SimConfig, late: Option<Late>, faults: &[EmulatorFault], count: u32) -> Vec<(JumpError, TrialEnd)> {
    jumps_on(ObjectiveSource::Estimate, count, 1, |seed| {
        let mut robot = Lockstep::new(config, seed);
        robot.with_truth = true;
        robot.late = late.as_ref().map(|late| late.seeded(seed));
        WithoutBodyContact { robot, faults: faults.to_vec(), elapsed_ms: 0 }
    })
}

/// Checks thirty jumps: robots that jumped settle, and the error of the displacement is within the limits that hold
/// without gaps.
fn known(name: &str, world: World, late: Option<Late>, faults: &[EmulatorFault]) {
    let jumps = jumps(&world.config(), late, faults, 30);
    let settled: Vec<_> = jumps.iter().filter(|(_, end)| *end == TrialEnd::Settled).map(|(error, _)| error).collect();
    let of = |share| percentile(settled.iter().map(|error| error.displacement_m()), share);
    let (median, most, worst) = (of(0.5), of(0.95), of(1.0));
    println!(
        "{name}: {} of {} settled; median {median:.4} m, 95 % {most:.4} m, worst {worst:.4} m",
        settled.len(),
        jumps.len()
    );
    assert!(settled.len() >= 12, "{name}: {} of {} settled: too few to judge by", settled.len(), jumps.len());
    assert!(median <= 0.03 && most <= 0.08 && worst <= 0.15, "{name}");
    let unquiet: Vec<_> = jumps.iter().filter(|(_, end)| *end == TrialEnd::NotQuiet).map(|(error, _)| error).collect();
    assert!(unquiet.is_empty(), "{name}: came to rest, and nobody knew: {unquiet:?}");
}

/// Regression: one of 36 such jumps was measured 0.3 m too long, and one standing robot was estimated 23 m away.
#[test]
fn a_gap_now_and_then_does_not_spoil_the_measure() {
    known("one gap in 200 ms, ideal", World::Ideal, Some(Late::new(200, 15, 0)), &[]);
    known("one gap in 200 ms, hardware-like", World::HardwareLike, Some(Late::new(200, 15, 0)), &[]);
}

#[test]
fn a_machine_that_is_late_fifteen_times_a_second_still_measures() {
    known("one gap in 50 ms, ideal", World::Ideal, Some(Late::new(50, 15, 0)), &[]);
    known("one gap in 50 ms, hardware-like", World::HardwareLike, Some(Late::new(50, 15, 0)), &[]);
}

#[test]
fn a_network_that_loses_and_overtakes_still_measures() {
    let faults = [EmulatorFault::Loss(5.0), EmulatorFault::Jitter(3.0)];
    known("5 % lost, 3 ms of jitter, ideal", World::Ideal, None, &faults);
    known("5 % lost, 3 ms of jitter, hardware-like", World::HardwareLike, None, &faults);
}
