//! The lines in which faults of an emulated robot are written.

use quadfrog::sim::emulator::{EmulatorFault, help};

#[test]
fn every_fault_is_parsed_as_help_writes_it() {
    let help = help();
    for row in help.lines() {
        // Two blanks, the usage, the description from column 29 on.
        let usage = row[2..28].trim_end();
        let words: Vec<&str> = usage.split(' ').collect();
        let operand = |word: &&str| match *word {
            "JOINT" => "RL_thigh".to_owned(),
            "BUTTONS" => "L2+B".to_owned(),
            unit => unit.to_owned(),
        };
        let mut line: Vec<String> = words.iter().map(operand).collect();
        // A unit is the last operand, in capitals.
        if let [_, .., unit] = words[..]
            && !["JOINT", "BUTTONS"].contains(&unit)
        {
            *line.last_mut().unwrap() = "3".to_owned();
        }
        let line = line.join(" ");
        let parsed = line.parse::<EmulatorFault>();
        assert!(parsed.is_ok(), "{line}: {parsed:?}");
        // The error of a wrong line has the same usage.
        let error = format!("{} a b c", words[0]).parse::<EmulatorFault>().unwrap_err().to_string();
        assert_eq!(error, format!("write it as: {usage}"));
    }
    assert_eq!(help.lines().count(), 32);
    assert_eq!("hot fr_CALF 82".parse(), Ok(EmulatorFault::Hot { joint: 2, celsius: 82.0 }));
}

#[test]
fn an_invalid_fault_is_refused_with_the_valid_form() {
    let message = |line: &str| line.parse::<EmulatorFault>().unwrap_err().to_string();
    assert!(message("los 5").contains("\"los\"") && message("los 5").contains("loss"));
    assert_eq!(message("loss"), "write it as: loss PERCENT");
    assert_eq!(message("hot FR_calf"), "write it as: hot JOINT CELSIUS");
    assert!(message("loss 101").contains("give 0 to 100 (PERCENT)"));
    assert!(message("loss nan").contains("nan"));
    assert!(message("stuck FR_knee").contains("FR_hip"));
    assert!(message("clear now").contains("write it as: clear"));
    assert!(message("").contains("known faults"));
    assert!(message("remote L9").contains("L2") && message("clock-step far").contains("MS"));
}
