//! The jumps of the running trial, from its ticks as they arrive.

use nalgebra::Vector3;
use quadfrog::robot::rotation::about_z;
use quadfrog::session::objective::along;
use quadfrog::telemetry::{Phase, Tick};
use quadfrog::trial::{Displacement, Task};

use super::session::SessionModel;

/// Jumps in a row so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JumpSeries {
    trial: Option<u32>,
    /// Time of the newest tick since the first impulse, s.
    time_s: f64,
    in_impulse: bool,
    jumps: Vec<LiveJump>,
}

/// One jump: position and yaw at the start of its impulse, and since then.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LiveJump {
    start_world: Vector3<f64>,
    start_yaw_rad: f64,
    now_world: Vector3<f64>,
    now_yaw_rad: f64,
    rise_m: f64,
}

impl JumpSeries {
    /// Records one tick. A new trial, or one that starts again, begins a new series.
    pub fn push(&mut self, tick: &Tick) {
        if tick.trial != self.trial || tick.trial_time_s < self.time_s {
            *self = JumpSeries { trial: tick.trial, ..JumpSeries::default() };
        }
        self.time_s = tick.trial_time_s;
        let (world, yaw_rad) = (tick.estimate.position_world, tick.estimate.roll_pitch_yaw.z);
        if let Some(jump) = self.jumps.last_mut() {
            jump.now_world = world;
            jump.now_yaw_rad = yaw_rad;
            jump.rise_m = jump.rise_m.max(world.z - jump.start_world.z);
        }
        let impulse = tick.trial.is_some() && tick.phase == Phase::Impulse;
        if impulse && !self.in_impulse {
            self.jumps.push(LiveJump {
                start_world: world,
                start_yaw_rad: yaw_rad,
                now_world: world,
                now_yaw_rad: yaw_rad,
                rise_m: 0.0,
            });
        }
        self.in_impulse = impulse;
    }

    /// The number of the present jump, and value and rise of the last finished one.
    pub fn line(&self, session: &SessionModel) -> String {
        let count = format!("Jump {} of {}", self.jumps.len(), session.jumps_in_a_row());
        match (self.jumps.len().checked_sub(2).map(|last| self.jumps[last]), session.info.task) {
            (Some(jump), Some(task)) => {
                let (value, unit) = (self.value(task, &jump), task.unit());
                format!("{count}; the last {value:+.2} {unit}, rise {:.2} m.", jump.rise_m)
            }
            _ => format!("{count}."),
        }
    }

    /// Displacement or turn of one jump in the direction of the task, m or rad.
    fn value(&self, task: Task, jump: &LiveJump) -> f64 {
        let yaw_init_rad = self.jumps[0].start_yaw_rad;
        let moved = about_z(-yaw_init_rad) * (jump.now_world - jump.start_world);
        let dyaw_rad = jump.now_yaw_rad - jump.start_yaw_rad;
        along(task, &Displacement { time_s: self.time_s, dx_m: moved.x, dy_m: moved.y, dyaw_rad })
    }
}
