//! The recording of a session: created with everything that describes it.

use std::path::Path;
use std::sync::Arc;

use super::folder::{attachments, utc_ns};
use super::options::{EngineError, Options};
use super::study::session_info;
use crate::recording::live::LiveServer;
use crate::recording::record::SessionInfo;
use crate::recording::scene::{Ground, GroundBox};
use crate::recording::session_writer::{BeginFile, RotationLimits, SessionWriter};
use crate::recording::writer::Writer;
use crate::session::experiment::next_seed;
use crate::sim::TerrainKind;
use crate::trial::{Backend, TrialRecord};
use nalgebra::Vector3;

/// Ground of a trial that begins, or with none of the start; for every file of a session.
type SharedGround = Arc<dyn Fn(Option<&TrialRecord>) -> Option<Ground> + Send + Sync>;

/// Creates the recording `path` of a session with `options`: facts, configuration, robot with its shapes, ground. It continues
/// in the next numbered file of its folder at the limits of `control.toml` (`[recording]`).
///
/// # Errors
/// As of [`Writer::create`].
pub fn create_recording(path: &Path, options: &Options) -> Result<SessionWriter, EngineError> {
    Ok(SessionWriter::create(path, limits(options), files_of(options, true))?)
}

/// Creates the writer of a session that keeps nothing and is shown live.
///
/// # Errors
/// As of [`create_recording`].
pub fn show_unrecorded(options: &Options) -> Result<SessionWriter, EngineError> {
    Ok(SessionWriter::create(Path::new("live.mcap"), limits(options), files_of(options, false))?)
}

fn limits(options: &Options) -> RotationLimits {
    let settings = options.config.control.recording;
    RotationLimits {
        bytes: u64::from(settings.rotate_mb) * 1_000_000,
        duration_ns: (settings.rotate_minutes * 60e9) as u64,
    }
}

/// Returns a function that begins a file of the session, or with `kept` false discards it. All have the same facts but their name.
fn files_of(options: &Options, kept: bool) -> BeginFile {
    let (info, start_utc_ns) = (session_info(options, ""), utc_ns());
    let thinned = !options.config.control.recording.full_rate;
    let owned = |(name, media, bytes): (&str, &str, &[u8])| (name.to_owned(), media.to_owned(), bytes.to_vec());
    let attached: Vec<_> = attachments(options).into_iter().map(owned).collect();
    let (robot, ground) = (options.robot.clone(), ground_of(options));
    let live = options.live.as_ref().map(LiveServer::feed);
    Box::new(move |path, begin_ns| {
        let info = SessionInfo { recording: path.display().to_string(), ..info.clone() };
        let attached: Vec<_> =
            attached.iter().map(|(name, media, bytes)| (name.as_str(), media.as_str(), &bytes[..])).collect();
        let mut writer = match kept {
            true => Writer::create_from(path, &info, start_utc_ns, begin_ns, &attached)?,
            false => Writer::into_sink(Box::new(std::io::sink()), path, &info, start_utc_ns, &attached)?,
        };
        if thinned {
            writer.thin_while_disarmed();
        }
        if let Some(live) = &live {
            writer.show_live(live.clone(), &info);
        }
        let ground = Arc::clone(&ground);
        writer.show(robot.clone(), Box::new(move |trial| ground(trial)))?;
        Ok(writer)
    })
}

/// Returns the ground of simulated trials by their seeds; under a real robot a plane.
fn ground_of(options: &Options) -> SharedGround {
    if options.backend == Backend::Hardware {
        return Arc::new(|_: Option<&TrialRecord>| Some(Ground { normal_world: Vector3::z(), boxes: Vec::new() }));
    }
    let terrain = options.config.simulator.terrain;
    let start = u64::from(options.seed);
    Arc::new(move |trial: Option<&TrialRecord>| {
        let seed = match trial {
            Some(row) => next_seed(row)?,
            None => start,
        };
        let (normal_world, boxes) = terrain.ground(seed);
        let thickness_m = terrain.blocks.thickness_m;
        let on_ground = |top: f64| if terrain.kind == TerrainKind::Blocks { top - thickness_m } else { 0.0 };
        let boxes = boxes.iter().map(|shape| GroundBox {
            center_m: shape.center,
            edges_m: shape.half_edges.map(|half| 2.0 * half),
            yaw_rad: shape.axis[1].atan2(shape.axis[0]),
            z_m: [on_ground(shape.top), shape.top],
        });
        Some(Ground { normal_world, boxes: boxes.collect() })
    })
}
