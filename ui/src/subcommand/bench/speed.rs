//! Speed of the simulator and of whole studies on this machine, compared with MuJoCo on request.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Instant;

use crate::put_line;
use anyhow::{Context, anyhow};
use clap::Args;
use quadfrog::sim::bench::{BenchScene, BlockTimes, SimulatorBench};

use super::machine;
use crate::subcommand::arguments::number_within;
use crate::subcommand::failure::Failure;
use crate::subcommand::interrupt::output_of;
use quadfrog::session::parallel::cores;
use quadfrog::unfinished::Unfinished;

/// Durations of a measurement, s: the least one holds some thousand steps on a slow machine.
const SECONDS: RangeInclusive<f64> = 0.1..=600.0;

#[derive(Debug, Args)]
pub struct SpeedArguments {
    /// Duration of each measurement, s
    #[arg(long, value_name = "S", default_value_t = 3.0, value_parser = number_within(SECONDS))]
    seconds: f64,
    /// Python script whose `bench SECONDS` prints MuJoCo's {"mj_steps_per_s_standing": ...} on the same model
    #[arg(long, value_name = "FILE")]
    mujoco: Option<PathBuf>,
    /// Also run 5 seeds of 3 tasks of 100 trials
    #[arg(long)]
    long: bool,
}

pub fn run(arguments: &SpeedArguments) -> Result<(), Failure> {
    if let Some(script) = arguments.mujoco.as_ref().filter(|script| !script.is_file()) {
        return Err(Failure::input(format!("--mujoco {}: there is no such file", script.display())));
    }
    machine::print_header(&format!(", {} cores", cores()));
    put_line!();
    let figures = SimulatorBench::new().measure(arguments.seconds * 5.0);
    put_line!("accelerations from torques                {:8.2} us", figures.dynamics_s * 1e6);
    for (scene, seconds) in BenchScene::ALL.iter().zip(figures.step_s) {
        put_line!("1 ms step, {:<31}{:8.2} us  {:8.0} steps/s", scene.name(), seconds * 1e6, 1.0 / seconds);
    }
    for BlockTimes { blocks, step_s, layout_s } in SimulatorBench::new().measure_blocks(arguments.seconds / 3.0) {
        let (step_us, layout_ms) = (step_s * 1e6, layout_s * 1e3);
        put_line!("1 ms step, standing on {blocks:>5} blocks        {step_us:8.2} us  laid in {layout_ms:.2} ms");
    }
    if let Some(script) = &arguments.mujoco {
        let theirs = mujoco(script, arguments.seconds)?;
        // The robot of the script stands on four feet, as in Scene::ALL[1].
        let (us, ratio) = (1e6 / theirs, 1.0 / figures.step_s[1] / theirs);
        put_line!(
            "MuJoCo, 1 ms step, standing on four feet  {us:8.2} us  {theirs:8.0} steps/s; quadfrog / MuJoCo: {ratio:.1}"
        );
    }
    put_line!();
    put_line!("optimize, 20 trials, start to finish      {:8.2} s", studies(&["--trials", "20"])?);
    if arguments.long {
        let several = ["--task", "forward,lateral-left,twist-ccw", "--seed", "0-4", "--trials", "100"];
        put_line!("optimize, 5 seeds of 3 tasks of 100 trials{:8.2} s", studies(&several)?);
    }
    Ok(())
}

/// Returns the duration of `quadfrog optimize` with these arguments in a temporary folder, s.
fn studies(arguments: &[&str]) -> Result<f64, Failure> {
    let program = std::env::current_exe().context("the path of this program")?;
    let folder = std::env::temp_dir().join(format!("quadfrog-bench-{}", std::process::id()));
    let _unfinished = Unfinished::enter(&folder);
    let start = Instant::now();
    let mut optimize = Command::new(program);
    optimize.arg("optimize").args(arguments).arg("--output").arg(&folder);
    let output = output_of(&mut optimize).context("optimize could not be started")?;
    let seconds = start.elapsed().as_secs_f64();
    // A leftover in the temporary directory is harmless.
    let _ = std::fs::remove_dir_all(&folder);
    if output.status.success() { Ok(seconds) } else { Err(ended("optimize", &output)) }
}

/// Returns MuJoCo's steps per second, measured by the script.
fn mujoco(script: &Path, seconds: f64) -> Result<f64, Failure> {
    let output = output_of(Command::new("python3").arg(script).arg("bench").arg(seconds.to_string()));
    let output = output.context("python3 could not be started")?;
    let name = script.display();
    if !output.status.success() {
        return Err(ended(&name.to_string(), &output));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let value: Option<serde_json::Value> = text.lines().rev().find_map(|line| serde_json::from_str(line).ok());
    let steps = value.and_then(|value| value["mj_steps_per_s_standing"].as_f64());
    steps.filter(|steps| steps.is_finite() && *steps > 0.0).ok_or_else(|| {
        let errors = String::from_utf8_lossy(&output.stderr);
        anyhow!("{name}: printed no mj_steps_per_s_standing above 0: {}", errors.trim()).into()
    })
}

/// Returns the failure of a program that ended with another status than 0, with its messages.
fn ended(name: &str, output: &Output) -> Failure {
    let errors = String::from_utf8_lossy(&output.stderr);
    anyhow!("{name} ended with {}: {}", output.status, errors.trim()).into()
}
