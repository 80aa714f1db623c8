//! `quadfrog bench`: the simulator's speed on this machine, beside MuJoCo's where that is at hand.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use clap::{Args, Subcommand};
use color_eyre::eyre::{WrapErr, eyre};
use quadfrog::sim::bench::{BenchScene, SimulatorBench};

use super::Failure;

#[derive(Debug, Subcommand)]
enum Which {
    /// How late the control thread wakes and what a tick costs
    Loop(super::bench_loop::LoopArguments),
}

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct BenchArguments {
    #[command(subcommand)]
    which: Option<Which>,
    /// How long each figure is measured, s
    #[arg(long, value_name = "S", default_value_t = 3.0)]
    seconds: f64,
    /// A script whose `bench SECONDS` prints MuJoCo's {"mj_steps_per_s_standing": ...} on the same model, run with python3
    #[arg(long, value_name = "FILE")]
    mujoco: Option<PathBuf>,
    /// Also the long run: 5 seeds of 3 tasks of 100 trials
    #[arg(long)]
    long: bool,
}

pub fn run(arguments: &BenchArguments) -> Result<(), Failure> {
    if let Some(Which::Loop(arguments)) = &arguments.which {
        return super::bench_loop::run(arguments);
    }
    if !(arguments.seconds > 0.0 && arguments.seconds <= 600.0) {
        return Err(Failure::input(format!("--seconds {}: give more than 0 and at most 600", arguments.seconds)));
    }
    if let Some(script) = arguments.mujoco.as_ref().filter(|script| !script.is_file()) {
        return Err(Failure::input(format!("--mujoco {}: there is no such file", script.display())));
    }
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    println!("{}, {cores} cores, quadfrog {}", machine(), env!("CARGO_PKG_VERSION"));
    if cfg!(debug_assertions) {
        println!("This is a debug build: for figures that count, run it with cargo run --release.");
    }
    println!();
    let figures = SimulatorBench::new().measure(arguments.seconds * 5.0);
    println!("accelerations from torques                {:8.2} us", figures.dynamics_s * 1e6);
    for (scene, seconds) in BenchScene::ALL.iter().zip(figures.step_s) {
        println!("1 ms step, {:<31}{:8.2} us  {:8.0} steps/s", scene.name(), seconds * 1e6, 1.0 / seconds);
    }
    if let Some(script) = &arguments.mujoco {
        let theirs = mujoco(script, arguments.seconds)?;
        // BenchScene::ALL[1] is standing on four feet, as the script's robot does.
        let ours = 1.0 / figures.step_s[1];
        println!(
            "MuJoCo, 1 ms step, standing on four feet  {:8.2} us  {theirs:8.0} steps/s; ours: {:.1} times as many",
            1e6 / theirs,
            ours / theirs
        );
    }
    println!();
    let seconds = studies(&["--trials", "20"])?;
    println!("optimize, 20 trials, start to finish      {seconds:8.2} s");
    if arguments.long {
        let several = ["--task", "forward,lateral-left,twist-ccw", "--seed", "0-4", "--trials", "100"];
        println!("optimize, 5 seeds of 3 tasks of 100 trials{:8.2} s", studies(&several)?);
    }
    Ok(())
}

/// How long `quadfrog optimize` takes with these arguments, s: the program as it is, in a folder of its own.
fn studies(arguments: &[&str]) -> Result<f64, Failure> {
    let program = std::env::current_exe().wrap_err("the program cannot find itself")?;
    let folder = std::env::temp_dir().join(format!("quadfrog-bench-{}", std::process::id()));
    let start = Instant::now();
    let status = Command::new(program)
        .arg("optimize")
        .args(arguments)
        .arg("--output")
        .arg(&folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .wrap_err("optimize could not be started")?;
    let seconds = start.elapsed().as_secs_f64();
    // What is left behind in the system's folder for passing things does no harm.
    let _ = std::fs::remove_dir_all(&folder);
    if status.success() { Ok(seconds) } else { Err(eyre!("optimize ended with {status}").into()) }
}

/// MuJoCo's steps per second, from the script.
fn mujoco(script: &Path, seconds: f64) -> Result<f64, Failure> {
    let output = Command::new("python3").arg(script).arg("bench").arg(seconds.to_string()).output();
    let output = output.wrap_err("python3 could not be started")?;
    let said = String::from_utf8_lossy(&output.stdout);
    let value: Option<serde_json::Value> = said.lines().rev().find_map(|line| serde_json::from_str(line).ok());
    value.and_then(|value| value["mj_steps_per_s_standing"].as_f64()).ok_or_else(|| {
        Failure::Other(eyre!(
            "{}: no figure came out: {}",
            script.display(),
            String::from_utf8_lossy(&output.stderr).trim()
        ))
    })
}

/// The processor's name, as the system gives it.
pub fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    model.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}
