//! The prior of the sampler `sim`: robots of the ensemble, their jumps, and the configuration of both.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use quadfrog::config::{Config, ConfigError, ConfigLayer};
use quadfrog::engine::{fingerprint, prior_plan};
use quadfrog::optimize::prior::Prior;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::evaluation::evaluate;
use quadfrog::session::prior::{
    EnsembleError, PriorPlan, PriorProgress, SIMULATION_VERSION, draw_robot, ensemble, simulate,
};
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::{ActuatorKind, SimConfig, Simulator};
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{Backend, JumpParameters, ParameterValues, Task};

fn go1() -> RobotDescription {
    RobotDescription::embedded("go1").unwrap()
}

fn layered(texts: &[(&str, &str)]) -> Result<Config, ConfigError> {
    let layers: Vec<_> = texts.iter().map(|(file, text)| ConfigLayer { file, origin: "the test", text }).collect();
    Config::layered(&layers)
}

/// Two robots and sixteen points.
const SMALL: &str = "worlds = 2\npoints = 16";

fn small(task: Task, texts: &[(&str, &str)]) -> PriorPlan {
    let config = layered(&[&[("prior.toml", SMALL)], texts].concat()).unwrap();
    prior_plan(&config, &go1(), task, Backend::Simulator).unwrap()
}

fn make(plan: &PriorPlan, jobs: usize) -> Prior {
    simulate(plan, jobs, &|_| (), &AtomicBool::new(false)).unwrap()
}

/// Every value to the bit.
fn bits(prior: &Prior) -> Vec<Option<u64>> {
    prior.worlds.iter().flat_map(|world| &world.values).map(|value| value.map(f64::to_bits)).collect()
}

#[test]
fn a_prior_has_the_same_bits_on_any_number_of_threads() {
    let plan = small(Task::Forward, &[]);
    let one = make(&plan, 1);
    assert_eq!(bits(&make(&plan, 3)), bits(&one));
    assert_eq!(make(&plan, 3).points, one.points);
    assert_ne!(one.worlds[0].values, one.worlds[1].values, "the robots differ");
    assert_eq!(one.worlds.iter().map(|world| world.name.as_str()).collect::<Vec<_>>(), ["world 1", "world 2"]);
    assert!(one.worlds.iter().all(|world| world.values.len() == one.points.len() && one.points.len() == 16));
    let falls = bits(&one).iter().filter(|value| value.is_none()).count();
    assert!(0 < falls && falls < 32, "{falls} of 32 jumps fell: the points do not cover the bounds");
}

/// Regression: the file of a prior was used again after a change of the simulation.
#[test]
fn a_change_of_the_simulated_jumps_raises_the_version_of_the_simulation() {
    let fitted = |task| {
        let mut prior = make(&small(task, &[("prior.toml", "points = 32")]), 2);
        prior.fit().unwrap();
        serde_json::to_vec(&prior).unwrap()
    };
    let sum = crc32fast::hash(&Task::ALL.map(fitted).concat());
    assert_eq!(
        (SIMULATION_VERSION, format!("{sum:08x}").as_str()),
        (1, "2159dc66"),
        "priors of the same configuration have become others: raise SIMULATION_VERSION and write both numbers here"
    );
}

/// A value is the objective that a study of the same robot measures at that point.
#[test]
fn a_value_is_the_objective_of_the_robot_at_the_point() {
    let plan = small(Task::TwistCcw, &[]);
    let prior = make(&plan, 2);
    let robots = ensemble(&plan.ensemble);
    let mut stood = 0;
    for (world, robot) in prior.worlds.iter().zip(&robots) {
        let (description, mut simulator) = robot.apply(&plan.robot, &plan.simulator);
        simulator.solver.tolerance_m_s = plan.ensemble.solver_tolerance_m_s;
        let mut rollout = Rollout::new(Simulator::new(&description, &simulator).unwrap(), &plan.settings);
        for (index, (point, value)) in prior.points.iter().zip(&world.values).enumerate() {
            let named = prior.parameters.iter().zip(point);
            let values: ParameterValues =
                named.map(|(parameter, unit)| (parameter.name.clone(), parameter.range.unscale(*unit))).collect();
            let jump = JumpParameters::from_values(&values, plan.control.f1_hz);
            let spec = TrialSpec { seed: index as u64, ..plan.control.trial(Task::TwistCcw, jump) };
            let run = evaluate(&mut rollout, &spec);
            assert_eq!(run.stood(), value.is_some(), "point {index}");
            assert_eq!(value.unwrap_or(0.0).to_bits(), run.value.to_bits(), "point {index}");
            stood += usize::from(run.stood());
        }
    }
    assert!(stood > 8, "{stood} of 32 jumps stood");
}

/// Jumps in a row with a frequency between them, per second, and a gain as the fifth parameter.
#[test]
fn jumps_in_a_row_and_five_parameters_have_a_prior() {
    let control = "[tasks.forward]\njumps = 2\nf1_hz = 1.0\nrate = true";
    let optimize = "[parameters]\nforward = [\"f0\", \"f1\", \"Fx\", \"Fz\", \"kp\"]";
    let plan = small(Task::Forward, &[("control.toml", control), ("optimize.toml", optimize)]);
    let prior = make(&plan, 2);
    assert_eq!(prior.parameters.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["f0", "f1", "Fx", "Fz", "kp"]);
    assert!(prior.points.iter().all(|point| point.len() == 5 && point.iter().all(|unit| (0.0..1.0).contains(unit))));
    // The same points with a fixed frequency and a fixed gain have other values.
    let mut fixed = plan.clone();
    for parameter in fixed.parameters.iter_mut().filter(|p| ["f1", "kp"].contains(&p.name.as_str())) {
        (parameter.low, parameter.high) = (parameter.high, parameter.high);
    }
    assert_ne!(bits(&make(&fixed, 2)), bits(&prior));
    // Per second and per jump: the same falls, other values.
    let mut per_jump = plan.clone();
    per_jump.control.rate = false;
    let (rate, mean) = (bits(&prior), bits(&make(&per_jump, 2)));
    assert_ne!(rate, mean);
    assert!(rate.iter().zip(&mean).all(|(rate, mean)| rate.is_some() == mean.is_some()));
}

#[test]
fn the_demanded_friction_names_the_amplitudes_of_the_task() {
    let slip = |names: &str| {
        let optimize = format!("[parameters]\nforward = {names}");
        let mut plan = small(Task::Forward, &[("optimize.toml", &optimize)]);
        (plan.ensemble.worlds, plan.ensemble.points) = (1, 1);
        make(&plan, 1).slip.map(|slip| (slip.horizontal.join(" "), slip.vertical))
    };
    assert_eq!(slip("[\"f0\", \"Fx\", \"Fz\"]"), Some(("Fx".to_owned(), "Fz".to_owned())));
    assert_eq!(slip("[\"Fy\", \"f0\", \"Fx\", \"Fz\"]"), Some(("Fx Fy".to_owned(), "Fz".to_owned())));
    assert_eq!(slip("[\"f0\", \"Fz\"]"), None);
    assert_eq!(slip("[\"f0\", \"Fx\"]"), None);
}

#[test]
fn progress_counts_every_jump_and_an_interrupt_ends_the_work() {
    let plan = small(Task::Forward, &[]);
    let seen = Mutex::new(Vec::new());
    let count = |PriorProgress { done, total }: PriorProgress| seen.lock().unwrap().push((done, total));
    simulate(&plan, 2, &count, &AtomicBool::new(false)).unwrap();
    let mut counted = seen.into_inner().unwrap();
    counted.sort_unstable();
    assert_eq!(counted, (1..=32).map(|done| (done, 32)).collect::<Vec<_>>());

    let interrupt = AtomicBool::new(false);
    let jumps = Mutex::new(0);
    let stop = |PriorProgress { done, .. }: PriorProgress| {
        *jumps.lock().unwrap() += 1;
        interrupt.store(done >= 3, Ordering::Relaxed);
    };
    assert_eq!(simulate(&plan, 1, &stop, &interrupt), Err(EnsembleError::Interrupted));
    assert_eq!(jumps.into_inner().unwrap(), 3, "no jump begins after the interrupt");
}

/// Each range is divided into as many parts as there are robots, with one robot in each.
#[test]
fn robots_of_an_ensemble_cover_every_range() {
    let mut settings = Config::load(None).unwrap().prior;
    for (worlds, seed) in [(8, 0), (8, 7), (16, 1)] {
        (settings.worlds, settings.seed) = (worlds, seed);
        let robots = ensemble(&settings);
        assert_eq!(robots.len(), worlds as usize);
        let masses = robots.iter().map(|robot| robot.mass);
        let friction = robots.iter().map(|robot| robot.friction);
        let parts = |values: &mut dyn Iterator<Item = f64>, [low, high]: [f64; 2]| {
            let mut parts: Vec<usize> =
                values.map(|value| ((value - low) / (high - low) * f64::from(worlds)) as usize).collect();
            parts.sort_unstable();
            parts
        };
        let all: Vec<usize> = (0..worlds as usize).collect();
        assert_eq!(parts(&mut masses.into_iter(), settings.ranges.mass), all);
        assert_eq!(parts(&mut friction.into_iter(), settings.ranges.friction), all);
    }
    let ranges = settings.ranges;
    assert_eq!(draw_robot(&ranges, 3), draw_robot(&ranges, 3));
    assert_ne!(draw_robot(&ranges, 3), draw_robot(&ranges, 4));
    assert_ne!(draw_robot(&ranges, settings.seed), ensemble(&settings)[0]);
    for seed in 0..100 {
        let robot = draw_robot(&ranges, seed);
        assert!((ranges.mass[0]..=ranges.mass[1]).contains(&robot.mass));
        assert!((ranges.delay_ms[0]..=ranges.delay_ms[1]).contains(&f64::from(robot.delay_ms)));
        assert!(
            (ranges.viscous_friction_nm_s[0]..=ranges.viscous_friction_nm_s[1]).contains(&robot.viscous_friction_nm_s)
        );
    }
}

/// Where all robots are weaker than the description, the points at which they stand let a robot with its full torque fall.
#[test]
fn some_robots_of_the_default_ensemble_have_the_full_torque() {
    let settings = Config::load(None).unwrap().prior;
    let robots = ensemble(&settings);
    let full = robots.iter().filter(|robot| robot.torque_limit >= 1.0).count();
    assert!((1..robots.len()).contains(&full), "{full} of {} robots have the full torque", robots.len());
    let drawn = (0..400).filter(|seed| draw_robot(&settings.ranges, *seed).torque_limit >= 1.0).count();
    assert!((80..=120).contains(&drawn), "{drawn} of 400 robots have the full torque");
}

#[test]
fn properties_change_the_robot_and_its_world_alone() {
    let ranges = Config::load(None).unwrap().prior.ranges;
    let mut properties = draw_robot(&ranges, 5);
    properties.delay_ms = 3;
    let (robot, simulator) = properties.apply(&go1(), &SimConfig::default());
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b.abs(), "{a} is not {b}");
    near(robot.total_mass(), properties.mass * go1().total_mass());
    near(robot.trunk.inertia_com[(1, 1)], properties.mass * properties.inertia * go1().trunk.inertia_com[(1, 1)]);
    let calf = |robot: &RobotDescription| robot.legs[2].bodies[2].inertia_com[(0, 0)];
    near(calf(&robot), properties.mass * calf(&go1()));
    near(robot.limits.max_torque[4], properties.torque_limit * go1().limits.max_torque[4]);
    assert_eq!(simulator.actuator.kind, ActuatorKind::HardwareLike);
    assert_eq!((simulator.sensors.enabled, simulator.sensors.delay_ms), (true, 3));
    assert_eq!((simulator.terrain.friction, simulator.terrain.friction_range), (properties.friction, None));
    assert_eq!(simulator.contact, SimConfig::default().contact);
    assert_eq!(robot.leg_geometry, go1().leg_geometry);
    simulator.check().unwrap();
}

#[test]
fn a_bad_value_of_prior_toml_is_refused_with_key_and_remedy() {
    for (text, expected) in [
        ("worlds = 1", "must be 2 to 64 robots"),
        ("points = 5000", "must be 16 to 4096 points"),
        ("[ranges]\nmass = [0.0, 1.0]", "must be 0.2 to 5 times the description's value"),
        ("[ranges]\nmass = [1.1, 0.9]", "`ranges.mass` = [1.1, 0.9]: must be [lowest, highest]"),
        ("[ranges]\nmass = [1.1]", "`ranges.mass`"),
        ("[ranges]\ndelay_ms = [0.0, 30.0]", "must be 0 to 20 ms"),
        ("[ranges]\nmas = [0.9, 1.1]", "did you mean `ranges.mass`?"),
    ] {
        let error = layered(&[("prior.toml", text)]).expect_err(text).to_string();
        assert!(error.contains(expected) && error.starts_with("the test"), "{text}: {error}");
    }
}

/// The kept copy and the fingerprint of a study have the settings of the prior; a copy of an older version has the defaults.
#[test]
fn the_kept_configuration_has_the_settings_of_the_prior() {
    let (default, small) = (layered(&[]).unwrap(), layered(&[("prior.toml", SMALL)]).unwrap());
    assert_ne!(fingerprint(&default, &go1()), fingerprint(&small, &go1()));
    let folder = tempfile::tempdir().unwrap();
    let written: Vec<PathBuf> = small.export(folder.path(), Task::Forward, &[], &[], &[]).unwrap();
    assert!(written.contains(&folder.path().join("prior.toml")));
    assert_eq!(Config::load(Some(folder.path())).unwrap().prior, small.prior);
    std::fs::remove_file(folder.path().join(Path::new("prior.toml"))).unwrap();
    assert_eq!(Config::load(Some(folder.path())).unwrap().prior, default.prior);
}
