//! Detection of a dead SSH connection by the kernel's table of connections.

use std::net::{SocketAddr, TcpListener, TcpStream};

use quadfrog_console::connection::{ConnectionMonitor, SshConnection, TerminalLocation};

fn text(there: SocketAddr, here: SocketAddr) -> String {
    format!("{} {} {} {}", there.ip(), there.port(), here.ip(), here.port())
}

/// IPv4, IPv6, and IPv4 through an IPv6 socket, as in sshd.
#[test]
fn a_live_connection_is_found_without_retransmissions() {
    for (listens, calls) in [("127.0.0.1:0", "127.0.0.1"), ("[::1]:0", "::1"), ("[::]:0", "127.0.0.1")] {
        let listener = TcpListener::bind(listens).unwrap();
        let port = listener.local_addr().unwrap().port();
        let client = TcpStream::connect((calls, port)).unwrap();
        let (_server, _) = listener.accept().unwrap();
        let text = text(client.local_addr().unwrap(), client.peer_addr().unwrap());
        let connection = SshConnection::parse(&text).unwrap();
        let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(|path| std::fs::read_to_string(path).unwrap_or_default());
        let found: Vec<u32> = tables.iter().filter_map(|table| connection.retransmissions(table)).collect();
        assert_eq!(found, [0], "{listens}: {text}");
    }
}

/// The middle line was recorded on Linux 6.18, 2 s after the peer of 10.7.0.2:2222 was disconnected.
#[test]
fn retransmissions_are_read_from_the_right_column_of_the_right_line() {
    let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   1: 0200070A:08AE 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 685353 1 0000000001cd59ae 100 0 0 10 0
   2: 0200070A:08AE 0100070A:9064 01 00007840:00000000 01:00000066 00000003     0        0 685421 3 00000000cd48d142 163 4 31 1 -1
   3: 0200070A:08AE 0100070A:9066 01 00000000:00000000 02:000AF8FB 00000000     0        0 685422 3 00000000cd48d142 20 4 30 113 -1
";
    let retransmissions = |text: &str| SshConnection::parse(text).unwrap().retransmissions(table);
    assert_eq!(retransmissions("10.7.0.1 36964 10.7.0.2 2222"), Some(3));
    assert_eq!(retransmissions("10.7.0.1 36966 10.7.0.2 2222"), Some(0));
    assert_eq!(retransmissions("10.7.0.1 36968 10.7.0.2 2222"), None);
    assert_eq!(retransmissions("10.7.0.2 2222 10.7.0.1 36964"), None, "with its ends swapped it is another connection");
}

#[test]
fn an_invalid_connection_is_none() {
    for text in ["", "10.7.0.1", "10.7.0.1 45268 10.7.0.2", "10.7.0.1 x 10.7.0.2 22", "host 1 10.7.0.2 22"] {
        assert_eq!(SshConnection::parse(text), None, "{text:?}");
    }
    let scoped = SshConnection::parse("fe80::1%eth0 45268 fe80::2%eth0 22");
    assert_eq!(scoped, SshConnection::parse("fe80::1 45268 fe80::2 22"));
    assert!(scoped.is_some());
    let ssh = "10.7.0.1 45268 10.7.0.2 22";
    for (set, place) in [
        (&[][..], TerminalLocation::Local),
        (&[("SSH_CONNECTION", "nonsense")], TerminalLocation::Ssh(None)),
        (&[("SSH_CONNECTION", ssh)], TerminalLocation::Ssh(SshConnection::parse(ssh))),
        (&[("SSH_CONNECTION", ssh), ("TMUX", "x")], TerminalLocation::Multiplexer),
        (&[("STY", "x")], TerminalLocation::Multiplexer),
        (&[("SUDO_USER", "x")], TerminalLocation::Sudo),
        (&[("SUDO_USER", "x"), ("SSH_CONNECTION", ssh)], TerminalLocation::Ssh(SshConnection::parse(ssh))),
    ] {
        let found =
            TerminalLocation::of(|name| set.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned()));
        assert_eq!(found, place, "{set:?}");
        assert!(ConnectionMonitor::watch(found).unwrap().alive());
    }
}

/// A connection that cannot be seen once counted as alive: the robot was armed without a word.
#[test]
fn a_connection_that_cannot_be_seen_says_why() {
    let unseen = |variables: &[(&str, &str)]| {
        let value = |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned());
        TerminalLocation::of(value).unseen()
    };
    assert_eq!(unseen(&[]), None);
    assert_eq!(unseen(&[("TMUX", "x")]), Some("tmux or screen hides its loss"));
    assert_eq!(unseen(&[("SUDO_USER", "x")]), Some("sudo removed SSH_CONNECTION"));
    assert_eq!(unseen(&[("SSH_CONNECTION", "nonsense")]), Some("SSH_CONNECTION cannot be read"));
    let elsewhere = "192.0.2.1 45268 192.0.2.2 22";
    assert_eq!(unseen(&[("SSH_CONNECTION", elsewhere)]), Some("SSH_CONNECTION is not in /proc/net/tcp"));
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let (_server, _) = listener.accept().unwrap();
    let here = text(client.local_addr().unwrap(), client.peer_addr().unwrap());
    assert_eq!(unseen(&[("SSH_CONNECTION", &here)]), None);
}
