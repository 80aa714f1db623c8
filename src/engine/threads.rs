//! The threads that an engine's end, and an error at its start, waits for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

use super::control_thread;
use super::guard::GuardHeartbeat;
use super::options::{EngineError, Options};
use crate::control::settings::ControlSettings;
use crate::realtime::channel::ControlPorts;
use crate::realtime::clock::MonotonicClock;
use crate::realtime::scheduling::{DeniedSetting, RealtimeSetting};
use crate::recording::recorder::RecorderHandle;
use crate::robot::Robot;
use crate::trial::Backend;

/// Receives the granted and denied real-time settings of the control thread once.
pub type ScheduledSettings = Receiver<(Vec<RealtimeSetting>, Vec<DeniedSetting>)>;

/// Threads of the control and of the recorder. Dropping it ends them, the control thread first, which feeds the recorder.
pub struct EngineThreads {
    /// Set when the control thread is to end.
    closing: Arc<AtomicBool>,
    control: Option<JoinHandle<()>>,
    recorder: Option<RecorderHandle>,
}

impl EngineThreads {
    /// The threads of an engine whose control thread is still to be started.
    pub fn of(recorder: RecorderHandle) -> EngineThreads {
        EngineThreads { closing: Arc::default(), control: None, recorder: Some(recorder) }
    }

    /// Returns the recorder; none after its end.
    pub fn recorder(&self) -> Option<&RecorderHandle> {
        self.recorder.as_ref()
    }

    /// Starts the control thread.
    pub fn spawn_control(
        &mut self,
        (mut robot, guard_heartbeat): (Box<dyn Robot>, Option<GuardHeartbeat>),
        control_end: ControlPorts,
        options: &Options,
        settings: &ControlSettings,
        clock: MonotonicClock,
    ) -> Result<ScheduledSettings, EngineError> {
        let (report, scheduled) = channel();
        let scheduling = options.config.scheduling(options.backend);
        let hardware = options.backend == Backend::Hardware;
        let (settings, closing) = (*settings, self.closing.clone());
        let run = move || {
            let start = control_thread::ControlThreadParts {
                settings: &settings,
                scheduling,
                report,
                clock: &clock,
                closing: &closing,
                hardware,
                guard_heartbeat,
            };
            control_thread::run(start, control_end, &mut *robot);
        };
        let spawned = std::thread::Builder::new().name("control".into()).spawn(run);
        self.control = Some(spawned.map_err(EngineError::not_started("control thread"))?);
        Ok(scheduled)
    }

    /// Ends the control thread. A panic of it was reported when it happened.
    pub fn end_control(&mut self) {
        self.closing.store(true, Ordering::Release);
        if let Some(control) = self.control.take() {
            let _ = control.join();
        }
    }

    /// Waits until the recorder has completed the recording: after the control thread's end, and after the last sender of records
    /// was dropped.
    pub fn end_recorder(&mut self) {
        if let Some(recorder) = self.recorder.take() {
            let _ = recorder.join();
        }
    }
}

impl Drop for EngineThreads {
    fn drop(&mut self) {
        self.end_control();
        self.end_recorder();
    }
}
