//! Every suggestion of Optuna 5.0.0's TPE in `tests/golden/tpe`, closed loop: the objective is computed here, so one wrong
//! suggestion changes all later ones. `QUADFROG_GOLDEN` selects another folder of golden data.

mod support;

use quadfrog::optimize::ask::{Ask, Direction, SamplerConfig, Streams};
use quadfrog::optimize::mt19937::Mt19937;
use quadfrog::optimize::parzen::{choose, observation_weights};
use quadfrog::optimize::sampler::propose;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::tpe::good_count;
use quadfrog::optimize::trial::{Distribution, Trial, TrialState, announcement};
use quadfrog::optimize::truncnorm::{log_cdf, log_mass, quantile};
use serde_json::Value;
use std::collections::HashMap;
use support::golden_tpe_file;

/// Largest difference allowed, as a share of the parameter's range.
const TOLERANCE: f64 = 1e-10;

fn golden(name: &str) -> Option<Value> {
    let path = golden_tpe_file(name)?;
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    Some(serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Settings common to the runs of a file.
struct Scenario<'a> {
    file: &'a Value,
    direction: Direction,
    log: Vec<&'a str>,
}

impl<'a> Scenario<'a> {
    fn new(file: &'a Value) -> Self {
        let direction = if file["direction"] == "minimize" { Direction::Minimize } else { Direction::Maximize };
        let log = file["log_params"].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect();
        Scenario { file, direction, log }
    }

    fn range(&self, name: &str) -> Range {
        let bounds = floats(&self.file["ranges"][name]);
        Range { low: bounds[0], high: bounds[1], log: self.log.contains(&name) }
    }

    fn names(&self, dim: &str) -> Vec<&'a str> {
        self.file["param_order"][dim].as_array().unwrap().iter().map(|v| v.as_str().unwrap()).collect()
    }

    /// The parameters of the trial that is re-run at `index`; the file's plan has its rank. They are those of this program's
    /// trial, which can differ from the file in the last bit: a re-run is bit-identical to its original.
    fn rerun(&self, index: usize, trials: &[Trial]) -> Option<Vec<(String, f64)>> {
        let plan = self.file["rerun_plan"].as_array()?;
        let rank = plan.iter().find(|entry| entry[0] == index)?[1].as_u64()? as usize;
        let mut complete: Vec<&Trial> = trials.iter().filter(|t| t.state == TrialState::Complete).collect();
        complete.sort_by(|a, b| self.direction.best_first(a.value.unwrap(), b.value.unwrap()));
        Some(complete[rank].parameters.clone())
    }

    /// Evaluates the objective of the file's `formula`, with the state of trials that fail or are pruned.
    fn evaluate(&self, trial: &Trial) -> (TrialState, Option<f64>) {
        let x = |name: &str| trial.parameter(name).unwrap();
        let u = |name: &str| (x(name) - self.range(name).low) / (self.range(name).high - self.range(name).low);
        let lateral = trial.parameter("Fy").is_some();
        let value = match self.file["objective"].as_str().unwrap() {
            "g_smooth" => {
                let (a, b, c) = (u("f0") - 0.35, u("Fx") - 0.6, u("Fz") - 0.25 - 0.5 * u("Fx"));
                let mut s = 1.0 + 4.0 * a * a + 3.0 * b * b + 5.0 * c * c;
                if lateral {
                    s += 2.0 * (u("Fy") - 0.4) * (u("Fy") - 0.4);
                }
                100.0 / s
            }
            "g_states" => {
                if trial.number % 9 == 4 {
                    return (TrialState::Fail, None);
                } else if trial.number % 17 == 11 {
                    return (TrialState::Pruned, None);
                } else if x("Fz") + 0.5 * x("Fx") < 190.0 * x("f0") {
                    0.0
                } else {
                    let a = x("Fz") / 200.0 - x("f0");
                    let v = x("f0") * (40.0 + x("Fx")) / (1.0 + a * a);
                    let e = if lateral { u("Fy") - 0.7 } else { 0.0 };
                    if lateral { v / (1.0 + 6.0 * e * e) } else { v }
                }
            }
            "g_log_min" => {
                let (a, b) = (x("f0") * x("Fz") / 250.0 - 1.1, u("Fx") - 0.3);
                let v = 7.0 * a * a + b * b;
                let e = if lateral { u("Fy") - 0.8 } else { 0.0 };
                if lateral { v + 0.5 * e * e } else { v }
            }
            other => panic!("objective {other} is unknown to this test"),
        };
        (TrialState::Complete, Some(value))
    }
}

/// Largest difference and number of suggestions compared.
#[derive(Default)]
struct Tally {
    compared: usize,
    largest: f64,
}

impl Tally {
    fn add(&mut self, other: &Tally) {
        self.compared += other.compared;
        self.largest = self.largest.max(other.largest);
    }

    fn compare(&mut self, ours: f64, theirs: f64, scale: f64, what: impl Fn() -> String) {
        let difference = (ours - theirs).abs() / scale;
        self.compared += 1;
        self.largest = self.largest.max(difference);
        assert!(difference <= TOLERANCE, "{}: ours {ours:e}, Optuna's {theirs:e}", what());
    }
}

impl std::fmt::Display for Tally {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} cases compared, largest difference {:.1e}", self.compared, self.largest)
    }
}

/// Repeats one run and compares every suggestion; returns the next doubles of both streams.
fn run(scenario: &Scenario<'_>, run: &Value, name: &str, tally: &mut Tally) -> [[f64; 2]; 2] {
    let dim = run["dim"].to_string();
    let names = scenario.names(&dim);
    let config = SamplerConfig {
        multivariate: run["multivariate"].as_bool().unwrap(),
        seed: run["seed"].as_u64().unwrap() as u32,
        ..SamplerConfig::default()
    };
    let mut streams = Streams::new(config.seed);
    let expected = run["x"].as_array().unwrap();
    let (fixed_plan, states) = (&run["fixed"], run["s"].as_str().unwrap().as_bytes());
    let zombie = |z: &Value| (z[0].as_u64().unwrap(), (z[1].as_u64().unwrap() as usize, z[2].as_u64()));
    let zombies = scenario.file["zombie_plan"].as_array().into_iter().flatten();
    let zombies: HashMap<u64, (usize, Option<u64>)> = zombies.map(zombie).collect();
    let mut trials: Vec<Trial> = Vec::new();
    for (index, theirs) in expected.iter().enumerate() {
        for (&late, _) in zombies.iter().filter(|(_, (_, end))| *end == Some(index as u64)) {
            let trial = &mut trials[late as usize];
            (trial.state, trial.value) = scenario.evaluate(trial);
        }
        let fixed = fixed_plan[index.to_string()].as_object().into_iter().flatten();
        let fixed = fixed.map(|(name, value)| (name.clone(), value.as_f64().unwrap())).collect();
        let fixed = scenario.rerun(index, &trials).unwrap_or(fixed);
        let zombie = zombies.get(&(index as u64));
        let asked = &names[..zombie.map_or(names.len(), |(suggested, _)| *suggested)];
        let space = Space::new(asked.iter().map(|n| ((*n).to_owned(), scenario.range(n)))).unwrap();
        let direction = scenario.direction;
        let ask = Ask { config: &config, trials: &trials, space: &space, fixed: &fixed, direction, prior: None };
        let candidate = propose(&ask, &mut streams);
        let mut trial = Trial::new(index as u32, TrialState::Running);
        for (k, (&parameter, value)) in asked.iter().zip(&candidate.values).enumerate() {
            let range = scenario.range(parameter);
            tally.compare(*value, theirs[k].as_f64().unwrap(), range.high - range.low, || {
                format!("{name} {config:?} dim {dim} trial {index} {parameter}")
            });
            trial.set(parameter, *value, Distribution::Float(range));
        }
        trial.system_attributes.extend(announcement(&candidate.joint));
        if zombie.is_none() {
            (trial.state, trial.value) = scenario.evaluate(&trial);
            assert_eq!(states[index], <&str>::from(trial.state).as_bytes()[0], "{name}: state of trial {index}");
        }
        trials.push(trial);
    }
    [[streams.model.double(), streams.model.double()], [streams.startup.double(), streams.startup.double()]]
}

fn units(file: &Value, after: &HashMap<String, [[f64; 2]; 2]>, tally: &mut Tally) {
    for (seed, doubles) in file["mt19937_doubles"].as_object().unwrap() {
        let mut stream = Mt19937::new(seed.parse().unwrap());
        let ours: Vec<f64> = floats(doubles).iter().map(|_| stream.double()).collect();
        assert_eq!(ours, floats(doubles), "doubles of seed {seed}");
        tally.compared += ours.len();
    }
    let later = &file["mt19937_after_700_doubles"];
    let mut stream = Mt19937::new(later["seed"].as_u64().unwrap() as u32);
    stream.advance_to(700);
    assert_eq!(floats(&later["next"]).iter().map(|_| stream.double()).collect::<Vec<_>>(), floats(&later["next"]));
    for (n, good) in file["gamma"].as_object().unwrap() {
        assert_eq!(good_count(n.parse().unwrap()) as u64, good.as_u64().unwrap(), "good trials of {n}");
        tally.compared += 1;
    }
    for (m, weights) in file["weights"].as_object().unwrap() {
        let ours = observation_weights(m.parse().unwrap());
        assert_eq!(ours.len(), weights.as_array().unwrap().len());
        for (i, (ours, theirs)) in ours.iter().zip(floats(weights)).enumerate() {
            tally.compare(*ours, theirs, 1.0, || format!("weight {i} of {m}"));
        }
    }
    let relative = |x: f64| x.abs().max(f64::MIN_POSITIVE);
    for (x, theirs) in floats(&file["log_ndtr"][0]).into_iter().zip(floats(&file["log_ndtr"][1])) {
        tally.compare(log_cdf(x), theirs, relative(theirs), || format!("ln Phi({x})"));
    }
    for (ab, theirs) in file["log_gauss_mass"][0].as_array().unwrap().iter().zip(floats(&file["log_gauss_mass"][1])) {
        let ab = floats(ab);
        tally.compare(log_mass(ab[0], ab[1]), theirs, theirs.abs().max(1.0), || format!("mass of {ab:?}"));
    }
    let (q, a, b) = (floats(&file["ppf"]["q"]), floats(&file["ppf"]["a"]), floats(&file["ppf"]["b"]));
    for (i, theirs) in floats(&file["ppf"]["x"]).into_iter().enumerate() {
        let what = || format!("quantile {} of {}..{}", q[i], a[i], b[i]);
        tally.compare(quantile(q[i], a[i], b[i]), theirs, b[i] - a[i], what);
    }
    let mut stream = Mt19937::new(file["choice"]["seed"].as_u64().unwrap() as u32);
    let weights = floats(&file["choice"]["p"]);
    for theirs in file["choice"]["idx"].as_array().unwrap() {
        assert_eq!(choose(&weights, &mut stream) as u64, theirs.as_u64().unwrap());
        tally.compared += 1;
    }
    for (run, next) in file["rng_after_run"].as_object().unwrap() {
        let [model, startup] = after.get(run).unwrap_or_else(|| panic!("no run `{run}` in the golden files"));
        assert_eq!(floats(&next["tpe_rng_next"]), model, "{run}: model stream");
        assert_eq!(floats(&next["random_sampler_rng_next"]), startup, "{run}: startup stream");
        tally.compared += 4;
    }
}

#[test]
fn golden_tpe() {
    let mut total = Tally::default();
    let mut after = HashMap::new();
    for name in ["smooth", "states", "enqueue", "logmin", "running", "rerun_stable"] {
        let Some(file) = golden(&format!("{name}.json")) else { continue };
        let scenario = Scenario::new(&file);
        let mut tally = Tally::default();
        let runs = file["runs"].as_array().unwrap();
        for one in runs {
            let next = run(&scenario, one, name, &mut tally);
            let multivariate = if one["multivariate"] == true { "True" } else { "False" };
            after.insert(
                format!("{name}.json seed {} dim {} multivariate {multivariate}", one["seed"], one["dim"]),
                next,
            );
        }
        println!("golden_tpe: {name}: {} runs, {tally}", runs.len());
        total.add(&tally);
    }
    if let Some(file) = golden("units.json") {
        let mut tally = Tally::default();
        units(&file, &after, &mut tally);
        println!("golden_tpe: units: {tally}");
        total.add(&tally);
    }
    assert!(total.compared > 0, "no golden data of the TPE found: is QUADFROG_GOLDEN right?");
    println!("golden_tpe: {total}");
}
