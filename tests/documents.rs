//! Statements of the documents about the tests, the messages and the packages.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

#[path = "support/skip.rs"]
mod skip;

use quadfrog::telemetry::{CommanderSign, Fault, SensorCheck};

/// Every test that docs/reliability.md names is in the file that it names.
#[test]
fn every_test_of_the_reliability_document_exists() {
    let document = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/reliability.md")).unwrap();
    let mut named = 0;
    let mut violations = Vec::new();
    for cell in document.lines().filter(|line| line.starts_with("| F")).flat_map(|line| line.split(['|', ';'])) {
        let mut quoted = cell.split('`').skip(1).step_by(2);
        let Some(file) = quoted.next().filter(|file| file.starts_with("tests/")) else { continue };
        let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file))
            .unwrap_or_else(|error| panic!("{file}: {error}"));
        for test in quoted {
            named += 1;
            if !text.contains(&format!("#[test]\nfn {test}()")) {
                violations.push(format!("{file} has no test {test}"));
            }
        }
    }
    assert!(named > 16, "only {named} tests are named");
    assert!(violations.is_empty(), "name the test that keeps the mend:\n{}", violations.join("\n"));
}

/// Prints the files of the Debian package, as `packaging/deb.py` places them.
const PACKED: &str = r#"
import importlib.util, tomllib
spec = importlib.util.spec_from_file_location("deb", "packaging/deb.py")
deb = importlib.util.module_from_spec(spec)
spec.loader.exec_module(deb)
table = tomllib.load(open("ui/Cargo.toml", "rb"))["package"]["metadata"]["deb"]
for pattern, destination, _ in table["assets"]:
    for source, below in deb.sources(pattern):
        print(destination + str(below or source.name))
"#;

/// Regression: the Debian package had the examples that the console compiles in, without `diagonal` and `far`.
#[test]
fn every_example_configuration_is_in_the_debian_package() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = fs::read_dir(root.join("examples")).unwrap().map(|entry| entry.unwrap().path());
    let files = folders.filter(|folder| folder.is_dir()).flat_map(|folder| fs::read_dir(folder).unwrap());
    let files =
        files.map(|entry| entry.unwrap().path()).filter(|file| file.extension().is_some_and(|end| end == "toml"));
    let examples: BTreeSet<String> =
        files.map(|file| file.strip_prefix(root.join("examples")).unwrap().display().to_string()).collect();
    let python = Command::new("python3").args(["-c", PACKED]).current_dir(root).output();
    let Some(output) = python.ok().filter(|output| output.status.success()) else {
        return skip::skip("Python 3.11 or newer is not installed");
    };
    let packed = String::from_utf8(output.stdout).unwrap();
    let place = "usr/share/doc/quadfrog/examples/config/";
    let packed: BTreeSet<String> =
        packed.lines().filter_map(|line| line.strip_prefix(place)).map(str::to_owned).collect();
    assert!(examples.len() > 15, "{examples:?}");
    assert_eq!(packed, examples);
}

/// One fault of each kind, with any numbers. The match has no wildcard: a new kind is added to the list, too.
fn faults() -> Vec<Fault> {
    let (joint, states) = (4, 6);
    let [measured_rad, allowed_rad, measured_n_m, allowed_n_m, measured_ms, allowed_ms] =
        [2.0, 1.0, 2.0, 1.0, 2.0, 1.0];
    let all = vec![
        Fault::NotFinite { what: "a joint angle" },
        Fault::Acceleration { measured_m_s2: 1e9, allowed_m_s2: 320.0, states },
        Fault::JointPosition { joint, measured_rad, allowed_rad },
        Fault::JointVelocity { joint, measured_rad_s: 2.0, allowed_rad_s: 1.0 },
        Fault::WantedTorque { joint, measured_n_m, allowed_n_m },
        Fault::JointTorque { joint, measured_n_m, allowed_n_m },
        Fault::StateAge { age_ms: 21, allowed_ms: 20 },
        Fault::LinkLost { age_ms: 201, allowed_ms: 200 },
        Fault::Corrupt { count: 11, allowed: 10 },
        Fault::Reboot,
        Fault::MotorMode { joint },
        Fault::MotorTemperature { joint, measured_c: 81.0, allowed_c: 80.0 },
        Fault::Tilt { measured_rad, allowed_rad },
        Fault::Late { measured_ms, allowed_ms },
        Fault::Slow { ticks: states, measured_ms, allowed_ms },
        Fault::PoseTimeout { error_rad: 0.5 },
        Fault::OperatorLost { silent_ms: 1001 },
        Fault::OperatorLeft,
        Fault::Send { errno: 101 },
        Fault::EventsLost,
        Fault::Sensors { check: SensorCheck::TurnRate, measured: 2.0, allowed: 1.0 },
        Fault::RobotClock { measured_ms: -60.0, allowed_ms: 50.0 },
        Fault::OtherCommander { sign: CommanderSign::LostStates, measured: 50.0, allowed: 5.0 },
        Fault::RemoteStop,
        Fault::RemoteSilent { silent_ms: 3001, allowed_ms: 3000 },
        Fault::Suspended { suspended_ms: 51, allowed_ms: 50 },
        Fault::GuardSilent { silent_ms: 71, allowed_ms: 70 },
        Fault::LinkDelay { measured_ms, allowed_ms },
        Fault::FollowingError { joint, measured_rad, allowed_rad },
        Fault::RampTorque { joint, measured_n_m, allowed_n_m },
    ];
    for fault in &all {
        match fault {
            Fault::NotFinite { .. } | Fault::Acceleration { .. } | Fault::JointPosition { .. } => {}
            Fault::JointVelocity { .. } | Fault::WantedTorque { .. } | Fault::JointTorque { .. } => {}
            Fault::StateAge { .. } | Fault::LinkLost { .. } | Fault::Corrupt { .. } | Fault::Reboot => {}
            Fault::MotorMode { .. } | Fault::MotorTemperature { .. } | Fault::Tilt { .. } | Fault::Late { .. } => {}
            Fault::Slow { .. } | Fault::PoseTimeout { .. } | Fault::OperatorLost { .. } | Fault::OperatorLeft => {}
            Fault::Send { .. } | Fault::EventsLost | Fault::Sensors { .. } | Fault::RobotClock { .. } => {}
            Fault::OtherCommander { .. } | Fault::RemoteStop | Fault::RemoteSilent { .. } => {}
            Fault::Suspended { .. } | Fault::GuardSilent { .. } | Fault::LinkDelay { .. } => {}
            Fault::FollowingError { .. } | Fault::RampTorque { .. } => {}
        }
    }
    all
}

/// Whether `message` has the quoted parts of a row in their order: `...` stands for any text, and any text may follow.
fn answers(quoted: &str, message: &str) -> bool {
    let mut rest = message;
    quoted.split("...").enumerate().all(|(number, part)| {
        let part = part.trim();
        let found = rest.find(part).filter(|at| number > 0 || *at == 0 || part.is_empty());
        found.inspect(|at| rest = &rest[at + part.len()..]).is_some()
    })
}

/// The hardware guide has the answer to each fault.
#[test]
fn every_fault_has_an_answer_in_the_hardware_guide() {
    let guide = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/hardware.md")).unwrap();
    let section = guide.split("## 5. On a fault").nth(1).unwrap().split("## 6.").next().unwrap();
    let rows: Vec<&str> = section.lines().filter(|line| line.starts_with("| `")).collect();
    let heads = rows.iter().filter_map(|row| row.split('|').nth(1));
    let quoted: Vec<&str> = heads.flat_map(|head| head.split('`').skip(1).step_by(2)).collect();
    let messages = faults().into_iter().map(|fault| fault.to_string());
    let missing: Vec<String> =
        messages.filter(|message| !quoted.iter().any(|quoted| answers(quoted, message))).collect();
    assert!(missing.is_empty(), "docs/hardware.md, section 5, has no row for\n{}", missing.join("\n"));
}
