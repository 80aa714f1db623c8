//! Duration of drawing a frame: `cargo bench -p quadfrog-console --bench draw`.
//!
//! For each view at 200x60 with a minute of telemetry, 100 trials and all series: the time until the frame is drawn into
//! the buffer and compared with the previous one. Wall time includes other work of the machine, processor time does not.

#[path = "../../tests/console/support/mod.rs"]
mod support;

use std::time::{Duration, Instant};

use nix::time::{ClockId, clock_gettime};
use quadfrog::recording::record::Record;
use quadfrog::robot::description::RobotDescription;
use quadfrog::telemetry::{Phase, Snapshot};
use quadfrog::trial::{ParameterInsight, ProposalInsight, Verdict};
use quadfrog_console::message::Msg;
use quadfrog_console::model::View;
use quadfrog_console::series::Series;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use strum::VariantArray;
use support::{Console, tick, trial};

/// Number of frames per view.
const FRAMES: u64 = 2_000;

/// Returns the processor time of this thread.
fn processor_time() -> Duration {
    Duration::from(clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).expect("the system has this clock"))
}

/// Returns a tick of a session with a jump every 4 s.
fn sample(time_ms: u64) -> quadfrog::telemetry::Tick {
    let in_jump_ms = time_ms % 4_000;
    let phase = match in_jump_ms {
        0..300 => Some(Phase::Impulse),
        300..600 => Some(Phase::Flight),
        600..1_500 => Some(Phase::Landing),
        _ => None,
    };
    let jump = phase.map(|phase| ((time_ms / 4_000) as u32, in_jump_ms as f64 / 1e3, phase));
    tick(time_ms, 0.3 * (time_ms as f64 / 300.0).sin(), jump)
}

/// Returns two densities of 100 points.
fn insight(name: &str) -> ParameterInsight {
    let at: Vec<f64> = (0..100).map(|i| 0.75 + 0.01 * f64::from(i)).collect();
    let bump = |middle: f64| at.iter().map(|x| (-((x - middle) / 0.1).powi(2)).exp()).collect();
    let (good, bad) = (bump(1.0), bump(1.5));
    ParameterInsight { name: name.into(), proposed: 1.0, importance: Some(0.5), at, good, bad }
}

fn main() {
    let mut console = Console::ready();
    console.model.robot = Some(RobotDescription::embedded("go1").expect("the built-in robot"));
    console.model.live.series = Series::VARIANTS.to_vec();
    for number in 0..100 {
        console.record(Record::Trial(trial(number, Some(Verdict::ALL[number as usize % 3]), None)));
    }
    for time_ms in (0..60_000).step_by(5) {
        console.update(Msg::Tick(Box::new(sample(time_ms))));
    }
    console.press(&["c"]);
    console.record(Record::Insight(ProposalInsight {
        trial: 0,
        parameters: ["f0", "Fx", "Fz"].map(insight).to_vec(),
        ..ProposalInsight::default()
    }));
    let mut terminal = Terminal::new(TestBackend::new(200, 60)).expect("a screen in memory");
    let mut time_ms = 60_000;
    for view in View::VARIANTS.iter().copied() {
        console.model.view = view;
        let (mut wall, mut processor) = (Vec::new(), Vec::new());
        for _ in 0..FRAMES {
            // 10 frames per second and 200 ticks per second.
            for _ in 0..20 {
                time_ms += 5;
                console.update(Msg::Tick(Box::new(sample(time_ms))));
            }
            let snapshot = Snapshot { tick: sample(time_ms), ..console.model.snapshot };
            console.update(Msg::Snapshot(Box::new(snapshot)));
            let (begun, used) = (Instant::now(), processor_time());
            terminal.draw(|frame| quadfrog_console::view::render(frame, &console.model)).expect("drawn");
            processor.push(processor_time() - used);
            wall.push(begun.elapsed());
        }
        wall.sort_unstable();
        processor.sort_unstable();
        let ms = |sorted: &[Duration], share: f64| {
            sorted[((sorted.len() - 1) as f64 * share).round() as usize].as_secs_f64() * 1e3
        };
        println!(
            "{:<9} at 200x60: processor p50 {:.2} ms, p99 {:.2} ms; wall p50 {:.2} ms, p99 {:.2} ms, longest {:.2} ms",
            view.name(),
            ms(&processor, 0.5),
            ms(&processor, 0.99),
            ms(&wall, 0.5),
            ms(&wall, 0.99),
            ms(&wall, 1.0),
        );
    }
}
