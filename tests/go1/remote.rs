//! Names of the buttons of the remote control.

use quadfrog::robot::remote::RemoteButtons;

#[test]
fn buttons_are_parsed_as_they_are_written() {
    for text in ["L2+B", "R1", "none", "start+select+left"] {
        assert_eq!(text.parse::<RemoteButtons>().unwrap().to_string(), text);
    }
    assert_eq!("l2+b".parse(), Ok(RemoteButtons(1 << 5 | 1 << 9)));
    assert!("L9".parse::<RemoteButtons>().unwrap_err().contains("known buttons: R1"));
    assert!("".parse::<RemoteButtons>().is_err());
}
