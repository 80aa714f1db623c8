//! The choice of the network interface to a Go2.

use std::net::Ipv4Addr;

use quadfrog::robot::description::RobotFiles;
use quadfrog::robot::go2::network::{Go2Network, NetworkInterface, parse_subnet};

fn chosen(all: &[(&str, [u8; 4])], wanted: &str) -> Result<Ipv4Addr, String> {
    let all: Vec<_> = all
        .iter()
        .map(|(name, address)| NetworkInterface { name: (*name).into(), address: (*address).into() })
        .collect();
    let network = Go2Network::read(&RobotFiles::embedded("go2").unwrap()).unwrap().unwrap();
    let network = Go2Network { interface: wanted.to_owned(), subnet: "192.168.123.0/24".to_owned(), ..network };
    network.address_among(&all).map_err(|error| error.to_string())
}

/// The machine's own interfaces differ from test to test, so the list is given.
#[test]
fn an_interface_is_used_only_where_it_is_the_only_one_that_fits() {
    let wired = ("eth0", [192, 168, 123, 99]);
    let wireless = ("wlan0", [192, 168, 123, 7]);
    let lo = ("lo", [127, 0, 0, 1]);
    assert_eq!(chosen(&[lo, wired], "").unwrap(), Ipv4Addr::from(wired.1));
    let two = chosen(&[lo, wired, wireless], "").unwrap_err();
    assert!(two.contains("eth0 192.168.123.99, wlan0 192.168.123.7") && two.contains("--interface"), "{two}");
    let none = chosen(&[lo], "").unwrap_err();
    assert!(none.contains("192.168.123.0/24") && none.contains("lo 127.0.0.1"), "{none}");
    for wanted in ["eth0", "192.168.123.99"] {
        assert_eq!(chosen(&[lo, wired, wireless], wanted).unwrap(), Ipv4Addr::from(wired.1));
    }
    let unknown = chosen(&[lo], "eth7").unwrap_err();
    assert!(unknown.contains("eth7") && unknown.contains("lo 127.0.0.1"), "{unknown}");
    let both = [wired, ("eth0", [10, 0, 0, 1])];
    assert!(chosen(&both, "eth0").unwrap_err().contains("several addresses"));
    assert_eq!(chosen(&both, "10.0.0.1").unwrap(), Ipv4Addr::new(10, 0, 0, 1));
}

#[test]
fn a_subnet_is_a_network_and_its_bits() {
    for wrong in ["", "192.168.123.0", "192.168.123.1/24", "192.168.123.0/33", "192.168.123.0/0", "a/24"] {
        assert_eq!(parse_subnet(wrong), None, "{wrong}");
    }
    assert_eq!(parse_subnet("192.168.123.0/24"), Some((0xC0A8_7B00, 0xFFFF_FF00)));
    assert_eq!(parse_subnet("10.0.0.1/32"), Some((0x0A00_0001, u32::MAX)));
}
