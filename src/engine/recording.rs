//! The recording of a session: created with everything that describes it.

use std::path::Path;

use super::folder::{attachments, utc_ns};
use super::options::{EngineError, Options};
use super::study::session_info;
use crate::recording::scene::{Ground, GroundBox};
use crate::recording::writer::{GroundOf, Writer};
use crate::session::experiment::next_seed;
use crate::sim::TerrainKind;
use crate::trial::{Backend, TrialRecord};
use nalgebra::Vector3;

/// Creates the recording `path` of a session with `options`: facts, configuration, robot with its shapes, ground.
///
/// # Errors
/// As of [`Writer::create`].
pub fn create_recording(path: &Path, options: &Options) -> Result<Writer, EngineError> {
    let info = session_info(options, &path.display().to_string());
    let mut writer = Writer::create(path, &info, utc_ns(), &attachments(options))?;
    writer.show(options.robot.clone(), ground_of(options))?;
    Ok(writer)
}

/// Returns the ground of simulated trials by their seeds; under a real robot a plane.
fn ground_of(options: &Options) -> GroundOf {
    if options.backend == Backend::Hardware {
        return Box::new(|_| Some(Ground { normal_world: Vector3::z(), boxes: Vec::new() }));
    }
    let terrain = options.config.simulator.terrain;
    let start = u64::from(options.seed);
    Box::new(move |trial: Option<&TrialRecord>| {
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
