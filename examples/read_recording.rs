//! Reads a recording: prints the session, then for each recorded trial its value, its verdict, the largest torque, and the
//! highest point of the trunk.
//!
//! `cargo run --release --example read_recording [FILE]`, without a file that of `recordings/samples/forward`.

use std::path::PathBuf;

use quadfrog::recording::player::Played;
use quadfrog::recording::timeline::Timeline;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let sample = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/samples/forward/session.mcap"));
    let file = std::env::args_os().nth(1).map_or_else(sample, PathBuf::from);
    let mut timeline = Timeline::open(&[file])?;
    let session = timeline.session();
    let task = session.task.map_or("unknown task", |task| task.name());
    println!("{task} on {}, {:.1} s", session.robot, timeline.duration_ns() as f64 * 1e-9);
    timeline.damage().iter().for_each(|damage| println!("damaged: {damage}"));

    // Rows are in memory; ticks are decoded when they are played.
    let rows = timeline.rows();
    for run in timeline.trials().to_vec() {
        timeline.seek(run.begin_ns);
        let (mut ticks, mut torque_n_m, mut height_m) = (0, 0.0f64, 0.0f64);
        for played in timeline.by_ref() {
            if played.time_ns() > run.end_ns {
                break;
            }
            if let Played::Tick(tick) = played {
                ticks += 1;
                height_m = height_m.max(tick.estimate.position_world.z);
                let torques = tick.state.joint_torque_n_m.iter();
                torque_n_m = torques.fold(torque_n_m, |largest, torque| largest.max(torque.abs()));
            }
        }
        let row = rows.get(&run.trial);
        let value = row.and_then(|row| row.value).map_or("no value".to_owned(), |value| format!("{value:.3}"));
        let verdict = row.and_then(|row| row.verdict_name()).unwrap_or("no verdict");
        println!(
            "trial {}: {value}, {verdict}; {ticks} ticks, torque up to {torque_n_m:.1} N m, height up to {height_m:.3} m",
            run.trial
        );
    }
    Ok(())
}
