//! The numbers and names of enums in `proto/frog.proto` are those of the program.

use prost_types::FileDescriptorSet;
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState, Mode, Phase};
use quadfrog::trial::{ExperimentStage, ProposalSource, Verdict};

/// Returns the name of a number of an enum in a message of the schema; none if the enum has no such number.
fn in_schema<'a>(schema: &'a FileDescriptorSet, [message, kind]: [&str; 2], number: i32) -> Option<&'a str> {
    let message = schema.file[0].message_type.iter().find(|known| known.name() == message).unwrap();
    let kind = message.enum_type.iter().find(|known| known.name() == kind).unwrap();
    kind.value.iter().find(|value| value.number() == number).map(|value| value.name())
}

/// `STAND UP` in the program is `STAND_UP` in the schema, `re-run` is `RE_RUN`.
fn assert_named(name: &str, in_schema: Option<&str>) {
    assert_eq!(Some(name.to_uppercase().replace([' ', '-'], "_").as_str()), in_schema);
}

#[test]
fn enums_are_numbered_as_in_the_schema() {
    let proto = concat!(env!("CARGO_MANIFEST_DIR"), "/proto");
    let schema = protox::compile(["frog.proto"], [proto]).unwrap();
    let of = |message, kind, number| in_schema(&schema, [message, kind], number);
    for (number, mode) in (0..).zip(Mode::ALL.iter().copied()) {
        assert_eq!(mode as i32, number);
        assert_named(mode.name(), of("ControlTick", "Mode", number));
    }
    for (number, phase) in (0..).zip(Phase::ALL.iter().copied()) {
        assert_eq!(phase as i32, number);
        assert_named(phase.name(), of("ControlTick", "Phase", number));
    }
    for (number, stage) in (0..).zip(ExperimentStage::ALL) {
        assert_eq!(stage as i32, number);
        assert_named(stage.name(), of("StageInfo", "Stage", number));
    }
    for (number, source) in (0..).zip(ProposalSource::ALL) {
        assert_eq!(source as i32, number);
        assert_named(source.name(), of("Proposal", "Source", number));
    }
    for (number, verdict) in (0..).zip(Verdict::ALL) {
        assert_eq!(verdict as i32, number);
        assert_named(verdict.name(), of("Trial", "Verdict", number));
    }
    // Their names are sentences; their numbers and count are what matters.
    for (number, check) in (0..).zip(ArmingCheck::ALL.iter().copied()) {
        assert_eq!(check as i32, number);
        assert!(of("PreArm", "Check", number).is_some(), "{check:?}");
    }
    for (number, state) in (0..).zip(ArmingCheckState::ALL.iter().copied()) {
        assert_eq!(state as i32, number);
        assert_named(state.name(), of("PreArm", "State", number));
    }
}
