//! The recording of a session: created with everything that describes it.

use std::path::Path;

use super::folder::{attachments, utc_ns};
use super::ground::TrialGround;
use super::options::{EngineError, Options};
use super::study::session_info;
use crate::recording::live::LiveServer;
use crate::recording::record::SessionInfo;
use crate::recording::session_writer::{BeginFile, RotationLimits, SessionWriter};
use crate::recording::writer::Writer;

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
    let (robot, ground) =
        (options.robot.clone(), TrialGround::new(&options.config, options.backend, options.seed.into()));
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
        writer.show(robot.clone(), Box::new(move |trial| ground.of(trial)))?;
        Ok(writer)
    })
}
