//! Whole jumps against MuJoCo, by the protocol of the reference: only feet and trunk collide, friction 1.0, ideal motors, 1.0 s of
//! settling, one impulse or several, 1.5 s until the outcome is read. `golden/jumps.json` holds jumps of the paper's controller,
//! `golden/jumps_terms.json` jumps with the attitude rate term and the foot placement, `golden/jumps_landing.json` with the landing
//! terms as well (written by `tests/support/reference_landing.py`), `golden/jumps_continuous.json` jumps in a row,
//! `golden/jumps_go2.json` jumps of the Go2 (written by `tests/support/reference_go2.py`). `golden/jumps_motors.json` holds jumps of robots
//! like those of a prior, by the protocol of this program's trials (written by `tests/support/reference_motors.py`).

mod support;

use std::collections::BTreeMap;

use nalgebra::Vector3;
use quadfrog::config::Config;
use quadfrog::control::foot_placement::SwingLegs;
use quadfrog::control::force_profile::amplitudes_leg;
use quadfrog::control::landing::LandingLegs;
use quadfrog::control::leg::{LegTarget, feet, torques};
use quadfrog::engine::prior_plan;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, LEGS, PerLeg, Placement, Robot};
use quadfrog::session::evaluation::evaluate;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::ensemble::RobotProperties;
use quadfrog::sim::{BodyKind, ContactLaw, SimConfig, Simulator};
use quadfrog::telemetry::{Cutoff, Estimate, LandingTerms, Tick};
use quadfrog::trial::{Backend, Gains, JumpParameters, Task};
use serde::Deserialize;

#[derive(Deserialize)]
struct File {
    stance_m: Stance,
    gains: Gains,
    floor_friction: f64,
    cases: Vec<Case>,
    /// Whether the motors compute the joint damping, as on hardware.
    #[serde(skip)]
    motor_damping: bool,
}

#[derive(Deserialize)]
struct Stance {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Deserialize)]
#[allow(non_snake_case, reason = "the file's names")]
struct Case {
    task: String,
    f0_hz: f64,
    Fx_n: f64,
    Fy_n: f64,
    Fz_n: f64,
    #[serde(default = "one")]
    jumps: u32,
    #[serde(default)]
    f1_hz: f64,
    #[serde(default)]
    terms: Terms,
    /// Properties of a robot of a prior by their names in prior.toml, without delay; none for the protocol with ideal motors.
    #[serde(default)]
    robot: Option<BTreeMap<String, f64>>,
    expect: Outcome,
}

fn one() -> u32 {
    1
}

/// Terms added to the paper's controller; zero without them.
#[derive(Deserialize, Default)]
struct Terms {
    attitude_rate_gain: f64,
    foot_placement_s: f64,
    #[serde(default)]
    landing: LandingTerms,
}

#[derive(Deserialize, Default, Debug)]
struct Outcome {
    fell: bool,
    takeoff_s: Option<f64>,
    apex_rise_m: f64,
    displacement_m: [f64; 3],
    yaw_change_rad: f64,
}

/// Runs one case by the protocol of the reference.
fn jump(robot: &RobotDescription, config: &SimConfig, file: &File, case: &Case) -> Outcome {
    let mut simulator = Simulator::new(robot, config).unwrap();
    let stance_leg = Vector3::new(file.stance_m.x, file.stance_m.y, file.stance_m.z);
    let joint_position = robot.leg_geometry.stance(&stance_leg, &robot.lying_position);
    assert!(simulator.place(&Placement { joint_position, lying: false, seed: 0 }));

    let task: Task = case.task.parse().unwrap();
    let profile =
        JumpParameters { f0_hz: case.f0_hz, f1_hz: case.f1_hz, fx_n: case.Fx_n, fy_n: case.Fy_n, fz_n: case.Fz_n };
    let (start, impulse) = (1.0, 0.5 / case.f0_hz);
    let period = impulse + if case.jumps > 1 { 0.5 / case.f1_hz } else { 0.0 };
    let end = start + f64::from(case.jumps - 1) * period + impulse;
    let ticks = ((end + 1.5) * 1000.0_f64).round_ties_even() as u32;
    let (mut swing, mut landing) = (SwingLegs::default(), LandingLegs::default());
    let mut outcome = Outcome::default();
    let (mut yaw, mut last_yaw) = (0.0, 0.0);
    let mut initial: Option<(Vector3<f64>, f64)> = None;
    for tick in 0..ticks {
        let t = f64::from(tick) * 0.001;
        let state = simulator.read().unwrap();
        let truth = state.truth.unwrap();
        let (roll, pitch, heading) = truth.world_from_body.euler_angles();
        let turn = heading - last_yaw + std::f64::consts::PI;
        yaw += turn.rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        last_yaw = heading;
        if initial.is_none() && t >= start - 1e-9 {
            initial = Some((truth.position_world, yaw));
        }
        let since = if t >= start - 1e-9 && t < end { (t - start).rem_euclid(period) } else { -1.0 };
        let active = since >= -1e-9 && since < impulse;
        let estimate = Estimate {
            velocity_world: truth.velocity_world,
            world_from_body: truth.world_from_body,
            angular_velocity_body: truth.angular_velocity_body,
            contact: truth.foot_contact,
            ..Estimate::default()
        };
        if t > start {
            swing.update(&truth.foot_contact);
            landing.update(&truth.foot_contact, swing.legs());
        }
        let theta_rad = std::f64::consts::PI + std::f64::consts::TAU * case.f0_hz * since.max(0.0);
        let cut_off = landing.cut_off(&case.terms.landing, theta_rad);
        let amplitudes = if active { amplitudes_leg(&profile, task) } else { PerLeg::default() };
        let velocity_body = estimate.world_from_body.inverse_transform_vector(&estimate.velocity_world);
        let placement_leg = swing.offsets_leg(case.terms.foot_placement_s, &velocity_body);
        let spread_leg = landing.spread_leg(&case.terms.landing);
        let target = LegTarget {
            gains: file.gains,
            stance_leg,
            vmc: true,
            attitude_rate_gain: case.terms.attitude_rate_gain,
            foot_offset_leg: std::array::from_fn::<_, LEGS, _>(|i| placement_leg[i] + spread_leg[i]),
            amplitudes_leg: std::array::from_fn(|i| if cut_off[i] { Vector3::zeros() } else { amplitudes[i] }),
            theta_rad,
        };
        let feet = feet(&robot.leg_geometry, &state.joint_position_rad);
        let torque = torques(&target, &feet, &state.joint_velocity_rad_s, &estimate);
        if let Some((origin, _)) = initial {
            outcome.apex_rise_m = outcome.apex_rise_m.max(truth.position_world.z - origin.z);
            if outcome.takeoff_s.is_none() && truth.foot_contact == [false; 4] {
                outcome.takeoff_s = Some(t - start);
            }
            outcome.fell |= roll.abs() > 1.0 || pitch.abs() > 1.0;
        }
        let command = if file.motor_damping {
            JointCommand::damped_torques(&torque, file.gains.kd_joint, &state.joint_velocity_rad_s)
        } else {
            JointCommand::torques(&torque)
        };
        simulator.write(&command).unwrap();
    }
    let (origin, initial_yaw) = initial.unwrap();
    outcome.displacement_m = (simulator.state().position_world - origin).into();
    outcome.yaw_change_rad = yaw - initial_yaw;
    outcome
}

/// Runs one case as this program runs a trial on a simulated robot with `properties`.
fn trial(robot: &RobotDescription, config: &SimConfig, case: &Case, properties: &BTreeMap<String, f64>) -> Outcome {
    let of = |name: &str| properties[name];
    let properties = RobotProperties {
        mass: of("mass"),
        inertia: of("inertia"),
        torque_limit: of("torque_limit"),
        full_torque_speed_share: of("full_torque_speed_share"),
        friction: of("friction"),
        delay_ms: 0,
        torque_lag_s: of("torque_lag_s"),
        dry_friction_nm: of("dry_friction_nm"),
        viscous_friction_nm_s: of("viscous_friction_nm_s"),
    };
    let (world_robot, mut world) = properties.apply(robot, config);
    world.sensors.enabled = false;
    let task: Task = case.task.parse().unwrap();
    let plan = prior_plan(&Config::load(None).unwrap(), robot, task, Backend::Simulator).unwrap();
    let point = JumpParameters { f0_hz: case.f0_hz, f1_hz: 0.0, fx_n: case.Fx_n, fy_n: case.Fy_n, fz_n: case.Fz_n };
    let mut rollout = Rollout::new(Simulator::new(&world_robot, &world).unwrap(), &plan.settings);
    let run = evaluate(&mut rollout, &plan.control.trial(task, point));
    let takeoff = |tick: &&Tick| tick.trial_time_s > 0.0 && tick.estimate.contact == [false; LEGS];
    let measured = run.measured.as_ref().unwrap();
    Outcome {
        fell: !run.stood(),
        takeoff_s: rollout.ticks().iter().find(takeoff).map(|tick| tick.trial_time_s),
        apex_rise_m: measured.apex_m,
        displacement_m: [measured.dx_m, measured.dy_m, 0.0],
        yaw_change_rad: measured.dyaw_rad,
    }
}

/// Returns the interpolated quantile `share` of the differences.
fn percentile(differences: &mut [f64], share: f64) -> f64 {
    differences.sort_by(f64::total_cmp);
    let place = (differences.len() - 1) as f64 * share;
    let (below, above) = (differences[place.floor() as usize], differences[place.ceil() as usize]);
    below + (above - below) * place.fract()
}

/// Differences of the jumps of a file from the reference's.
#[derive(Debug)]
struct Differences {
    /// Median and 95th percentile of the apex rise, percent.
    apex: f64,
    apex_95: f64,
    /// Medians: take-off time, ms; landing displacement, cm; yaw of twists, percent.
    takeoff_ms: f64,
    landing_cm: f64,
    twist: f64,
    /// Share of cases in which both fell or neither did, percent.
    agreement: f64,
}

impl Differences {
    /// The limits of whole jumps with the convex contact law.
    #[track_caller]
    fn assert_within_limits(&self) {
        assert!(self.apex <= 1.0 && self.apex_95 <= 4.0, "apex");
        assert!(self.takeoff_ms <= 5.0, "take-off");
        assert!(self.landing_cm <= 3.0, "landing");
        assert!(self.twist <= 5.0, "yaw of twists");
        assert!(self.agreement >= 90.0, "falls");
    }
}

impl std::fmt::Display for Differences {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "median differences: apex {:.2} % (95th percentile {:.2} %), take-off {:.1} ms, landing {:.1} cm, yaw of twists \
             {:.1} %; fallen or not agrees in {:.0} %",
            self.apex, self.apex_95, self.takeoff_ms, self.landing_cm, self.twist, self.agreement
        )
    }
}

/// Runs all cases and prints the table.
fn compare(robot: &RobotDescription, config: &SimConfig, file: &File) -> Differences {
    let (mut apex, mut takeoff, mut landing, mut twist) = (vec![], vec![], vec![], vec![]);
    let mut agree = 0;
    println!("task          f0   Fx   Fy   Fz |  here   there |   apex rise     | take-off | landing | yaw");
    for case in &file.cases {
        let found = match &case.robot {
            Some(properties) => trial(robot, config, case, properties),
            None => jump(robot, config, file, case),
        };
        let expect = &case.expect;
        let rise = 100.0 * (found.apex_rise_m / expect.apex_rise_m - 1.0);
        let off = 1000.0 * (found.takeoff_s.unwrap_or(f64::NAN) - expect.takeoff_s.unwrap_or(f64::NAN));
        let place = Vector3::from(found.displacement_m) - Vector3::from(expect.displacement_m);
        let place = 100.0 * place.xy().norm() / f64::from(case.jumps);
        let turn = found.yaw_change_rad - expect.yaw_change_rad;
        let fate = |fell: bool| if fell { "falls " } else { "stands" };
        println!(
            "{:12} {:.2} {:4.0} {:4.0} {:4.0} | {} {} | {:.3} m {:+5.2} % | {:+5.0} ms | {:4.1} cm | {:+.2} {:+.2} rad",
            case.task,
            case.f0_hz,
            case.Fx_n,
            case.Fy_n,
            case.Fz_n,
            fate(found.fell),
            fate(expect.fell),
            found.apex_rise_m,
            rise,
            off,
            place,
            expect.yaw_change_rad,
            turn,
        );
        agree += usize::from(found.fell == expect.fell);
        if found.fell || expect.fell {
            continue;
        }
        apex.push(rise.abs());
        takeoff.push(off.abs());
        landing.push(place);
        if case.task.starts_with("twist") {
            twist.push((100.0 * turn / expect.yaw_change_rad).abs());
        }
    }
    Differences {
        apex: percentile(&mut apex, 0.5),
        apex_95: percentile(&mut apex, 0.95),
        takeoff_ms: percentile(&mut takeoff, 0.5),
        landing_cm: percentile(&mut landing, 0.5),
        twist: percentile(&mut twist, 0.5),
        agreement: 100.0 * f64::from(agree as u32) / file.cases.len() as f64,
    }
}

/// The Go1 and a simulator set up as the reference is.
fn reference_setup(file: &File) -> (RobotDescription, SimConfig) {
    robot_setup("go1", file)
}

/// A robot and a simulator set up as the reference is.
fn robot_setup(name: &str, file: &File) -> (RobotDescription, SimConfig) {
    let mut config = SimConfig::default();
    config.terrain.friction = file.floor_friction;
    config.contact.bodies = vec![BodyKind::Trunk];
    (RobotDescription::embedded(name).unwrap(), config)
}

/// The joint damping in the motors, evaluated at each step of the simulator instead of each tick, is the same law with 0.75 in place of
/// 0.8 N m s/rad (steps of 1/16): twists turn 8 % further, all other limits hold.
#[test]
fn golden_jumps_with_damping_in_the_motors() {
    let file = File { motor_damping: true, ..support::golden("jumps.json") };
    let (robot, config) = reference_setup(&file);
    let found = compare(&robot, &config, &file);
    println!("golden_jumps: {} cases, damping in the motors: {found}", file.cases.len());
    assert!(found.apex <= 1.0 && found.apex_95 <= 4.0, "apex");
    assert!(found.takeoff_ms <= 5.0 && found.landing_cm <= 3.0 && found.twist <= 10.0, "take-off, landing, yaw");
    assert!(found.agreement >= 90.0, "falls");
}

/// With MuJoCo's convex contact law, as shipped, all quantities agree. With Coulomb's law feet that slide at the end of
/// a push stay on the ground, where MuJoCo's hop: the last foot leaves about 14 ms later and twists differ by several
/// percent; apex, landing position and falls agree.
#[test]
fn golden_jumps() {
    let file: File = support::golden("jumps.json");
    assert!(!file.cases.is_empty());
    let (robot, config) = reference_setup(&file);
    let law = |law| {
        let mut config = config.clone();
        config.contact.law = law;
        println!("\n{law:?} contact law");
        compare(&robot, &config, &file)
    };
    let (coulomb, convex) = (law(ContactLaw::Coulomb), law(ContactLaw::Convex));
    println!("\ngolden_jumps: {} cases, Coulomb's law: {coulomb}", file.cases.len());
    println!("golden_jumps: {} cases, convex law (as shipped): {convex}", file.cases.len());

    assert_eq!(config.contact.law, ContactLaw::Convex);
    convex.assert_within_limits();
    assert!(coulomb.apex <= 1.5 && coulomb.apex_95 <= 4.0, "apex with Coulomb's law");
    assert!(coulomb.landing_cm <= 4.0, "landing with Coulomb's law");
    assert!(coulomb.agreement >= 75.0, "falls with Coulomb's law");
}

/// The Go2, whose head collides with the ground as well, with the paper's controller and its own stance and bounds.
#[test]
fn golden_jumps_of_the_go2() {
    let file: File = support::golden("jumps_go2.json");
    let (robot, config) = robot_setup("go2", &file);
    let found = compare(&robot, &config, &file);
    println!("golden_jumps: {} cases of the Go2: {found}", file.cases.len());
    found.assert_within_limits();
}

/// The attitude rate term and the foot placement do in this simulator what they do in MuJoCo.
#[test]
fn golden_jumps_with_the_added_terms() {
    let file: File = support::golden("jumps_terms.json");
    assert!(file.cases.iter().all(|case| case.terms.attitude_rate_gain > 0.0 && case.terms.foot_placement_s > 0.0));
    let (robot, config) = reference_setup(&file);
    let found = compare(&robot, &config, &file);
    println!("golden_jumps: {} cases with the added terms: {found}", file.cases.len());
    found.assert_within_limits();
}

/// The cut-off of the profile force and the spread of the swing feet do in this simulator what they do in MuJoCo.
#[test]
fn golden_jumps_with_the_landing_terms() {
    let file: File = support::golden("jumps_landing.json");
    let landing = |case: &Case| case.terms.landing;
    assert!(file.cases.iter().all(|case| landing(case).cutoff == Cutoff::Foot && landing(case).spread_m > 0.0));
    let (robot, config) = reference_setup(&file);
    let found = compare(&robot, &config, &file);
    println!("golden_jumps: {} cases with the landing terms: {found}", file.cases.len());
    found.assert_within_limits();
}

/// The trials of this program on robots of a prior, with torque-speed curve, lag, rotors and friction in the joints, end as MuJoCo's jumps.
#[test]
fn golden_jumps_of_robots_of_a_prior() {
    let file: File = support::golden("jumps_motors.json");
    assert!(file.cases.iter().all(|case| case.robot.is_some()));
    let (robot, mut config) = reference_setup(&file);
    // The reference knows no fall by contact of the trunk.
    config.contact.fall_bodies.clear();
    let found = compare(&robot, &config, &file);
    println!("golden_jumps: {} cases of robots of a prior: {found}", file.cases.len());
    found.assert_within_limits();
}

/// Several jumps in a row; the landing's distance is that of the last one, divided by the number of jumps.
///
/// Errors grow from jump to jump. Where this simulator's own outcome depends on its step (2, 4 or 8 contact substeps), the jumps are
/// too close to a fall for two simulators to agree: such cases are counted apart.
#[test]
fn golden_jumps_in_a_row() {
    let file: File = support::golden("jumps_continuous.json");
    assert!(file.cases.iter().all(|case| case.jumps > 1 && case.f1_hz > 0.0));
    let (robot, config) = reference_setup(&file);
    let found = compare(&robot, &config, &file);
    println!("golden_jumps: {} cases of jumps in a row: {found}", file.cases.len());
    let finer = [2, 4].map(|factor| {
        let mut config = config.clone();
        config.step.contact_substeps *= factor;
        config
    });
    let (mut decided, mut agree) = (0, 0);
    for case in &file.cases {
        let fell = jump(&robot, &config, &file, case).fell;
        if finer.iter().all(|config| jump(&robot, config, &file, case).fell == fell) {
            decided += 1;
            agree += usize::from(fell == case.expect.fell);
        }
    }
    println!("golden_jumps: fallen or not agrees in {agree} of the {decided} cases that do not depend on the step");
    assert!(found.apex <= 2.0, "apex");
    assert!(found.landing_cm <= 5.0, "landing");
    assert!(10 * agree >= 9 * decided && 4 * decided >= 3 * file.cases.len(), "falls");
}
