//! The socket of a link to a Go1: datagrams of the cache warm-up, and commands that the system refuses to send.

use std::net::Ipv4Addr;

use quadfrog::robot::LinkStatus;
use quadfrog::robot::go1::link::{Link, LinkOptions};
use quadfrog::robot::go1::packet::{CrcForm, LowCmd};
use quadfrog::robot::state_counter::StateClock;

/// Consecutive refusals of the system that are no error.
const TOLERATED_REFUSALS: u32 = 5;
const CLOCK: StateClock = StateClock { state_period_ms: 1, restart_ms: 100 };

/// (`tests/control/warm_up.rs` checks that a warm-up changes nothing.)
#[test]
fn a_warm_up_sends_an_invalid_datagram_to_itself() {
    let address = (Ipv4Addr::LOCALHOST, 9).into();
    let mut link = Link::open(&LinkOptions { address, local_port: 0, clock: CLOCK }).unwrap();
    let command = LowCmd::braking(CrcForm::Plain);
    assert_eq!(link.warm_up(command), None, "there is no state yet");
    let received = &link.buffer()[..command.bytes().len()];
    assert_eq!(received[2..], command.bytes()[2..]);
    assert!(LowCmd::parse(received, CrcForm::Plain).is_err());
    assert_eq!(*link.status(), LinkStatus::default());
}

/// No socket can be made to refuse every send, so the system's answer is injected.
#[test]
fn refused_sends_become_an_error_after_five() {
    let address = (Ipv4Addr::LOCALHOST, 9).into();
    let options = LinkOptions { address, local_port: 0, clock: CLOCK };
    let mut link = Link::open(&options).unwrap();
    let full = nix::errno::Errno::EAGAIN as i32;
    let refused = || Err(std::io::Error::from_raw_os_error(full));
    for _ in 0..2 {
        for _ in 0..TOLERATED_REFUSALS {
            assert_eq!(link.count_sent(refused()), Ok(()), "a full queue is tolerated for five milliseconds");
        }
        assert_eq!(link.count_sent(refused()), Err(full));
        assert_eq!(link.count_sent(refused()), Err(full), "until one is sent");
        assert_eq!(link.count_sent(Ok(614)), Ok(()), "the first one that is sent ends the error");
    }
    assert_eq!((link.status().sent, link.status().send_errors), (2, 14), "each is counted");
}
