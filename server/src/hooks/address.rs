//! Which addresses the service may be made to call. Whoever registers a URL must not reach through it what only the
//! server reaches: its own machine, its network, the metadata of its cloud.
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

/// Who is behind an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reach {
    /// Somebody in the Internet.
    Public,
    /// This machine or its surroundings.
    Private,
    /// Nobody: it stands for many, for none, or for something in a book.
    Never,
}

use Reach::{Never, Private, Public};

/// Of the IANA registry of special addresses (IPv4) what is not public.
const V4: &[([u8; 4], u8, Reach)] = &[
    ([0, 0, 0, 0], 8, Never),        // "this network"
    ([10, 0, 0, 0], 8, Private),     // private use
    ([100, 64, 0, 0], 10, Private),  // behind a carrier's NAT
    ([127, 0, 0, 0], 8, Private),    // loopback
    ([169, 254, 0, 0], 16, Private), // link-local, and metadata of clouds
    ([172, 16, 0, 0], 12, Private),  // private use
    ([192, 0, 0, 0], 24, Never),     // protocol assignments
    ([192, 0, 2, 0], 24, Never),     // documentation
    ([192, 88, 99, 0], 24, Never),   // relays of 6to4
    ([192, 168, 0, 0], 16, Private), // private use
    ([198, 18, 0, 0], 15, Private),  // benchmarks of one's own network
    ([198, 51, 100, 0], 24, Never),  // documentation
    ([203, 0, 113, 0], 24, Never),   // documentation
    ([224, 0, 0, 0], 4, Never),      // multicast
    ([240, 0, 0, 0], 4, Never),      // reserved, and broadcast
];

/// The same for IPv6; the first that fits. What is in none of them and not in 2000::/3 is nobody's.
const V6: &[([u16; 8], u8, Reach)] = &[
    ([0, 0, 0, 0, 0, 0, 0, 1], 128, Private),        // loopback
    ([0x64, 0xff9b, 1, 0, 0, 0, 0, 0], 48, Private), // translation of one's own network
    ([0xfc00, 0, 0, 0, 0, 0, 0, 0], 7, Private),     // private use
    ([0xfe80, 0, 0, 0, 0, 0, 0, 0], 10, Private),    // link-local
    ([0xfec0, 0, 0, 0, 0, 0, 0, 0], 10, Private),    // site-local, of old
    ([0x2001, 0, 0, 0, 0, 0, 0, 0], 23, Never),      // protocol assignments, Teredo among them
    ([0x2001, 0xdb8, 0, 0, 0, 0, 0, 0], 32, Never),  // documentation
    ([0x2002, 0, 0, 0, 0, 0, 0, 0], 16, Never),      // 6to4, which leads to any address of version 4
    ([0x3fff, 0, 0, 0, 0, 0, 0, 0], 20, Never),      // documentation
    ([0x2000, 0, 0, 0, 0, 0, 0, 0], 3, Public),      // all that is given out
];

/// Who is behind an address. One that stands for an address of version 4 is what that is.
pub fn reach(address: IpAddr) -> Reach {
    match address {
        IpAddr::V4(v4) => of_v4(v4),
        IpAddr::V6(v6) => match embedded(v6) {
            Some(v4) => of_v4(v4),
            None => of_v6(v6),
        },
    }
}

fn of_v4(address: Ipv4Addr) -> Reach {
    let bits = address.to_bits();
    let found = V4.iter().find(|(network, length, _)| {
        let mask = u32::MAX << (32 - length);
        bits & mask == Ipv4Addr::from(*network).to_bits()
    });
    found.map_or(Public, |(_, _, reach)| *reach)
}

fn of_v6(address: Ipv6Addr) -> Reach {
    let bits = address.to_bits();
    let found = V6.iter().find(|(network, length, _)| {
        let mask = u128::MAX << (128 - length);
        bits & mask == Ipv6Addr::from(*network).to_bits()
    });
    found.map_or(Never, |(_, _, reach)| *reach)
}

/// The address of version 4 that one of version 6 stands for: mapped (::ffff:0:0/96), or translated for networks
/// without version 4 (64:ff9b::/96).
fn embedded(address: Ipv6Addr) -> Option<Ipv4Addr> {
    if let Some(v4) = address.to_ipv4_mapped() {
        return Some(v4);
    }
    let translated = matches!(address.segments(), [0x64, 0xff9b, 0, 0, 0, 0, _, _]);
    // The lower 32 bits.
    translated.then(|| Ipv4Addr::from_bits(address.to_bits() as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_special_address_is_known() {
        let table = [
            (
                Public,
                "1.1.1.1 8.8.8.8 93.184.215.14 100.63.255.255 100.128.0.0 172.15.255.255 172.32.0.0 169.253.0.1 \
                 192.0.1.0 192.167.255.255 192.169.0.0 198.17.0.0 198.20.0.0 223.255.255.255 11.0.0.0 126.255.255.255 \
                 2606:4700:4700::1111 2001:200::1 2001:4860:4860::8888 2a00:1450::1 3ffe:ffff::1 ::ffff:8.8.8.8 \
                 64:ff9b::8.8.8.8",
            ),
            (
                Private,
                "10.0.0.1 10.255.255.255 100.64.0.0 100.127.255.255 127.0.0.1 127.255.255.255 169.254.169.254 172.16.0.1 \
                 172.31.255.255 192.168.0.1 192.168.255.255 198.18.0.1 198.19.255.255 ::1 fc00::1 fd12:3456::1 fdff::1 \
                 fe80::1 febf::1 fec0::1 ::ffff:127.0.0.1 ::ffff:10.0.0.1 ::ffff:169.254.169.254 64:ff9b::10.0.0.1 \
                 64:ff9b::169.254.169.254 64:ff9b:1::1",
            ),
            (
                Never,
                "0.0.0.0 0.255.255.255 192.0.0.1 192.0.2.1 192.88.99.1 198.51.100.7 203.0.113.9 224.0.0.1 239.255.255.255 \
                 240.0.0.1 255.255.255.255 :: ::2 ::10.0.0.1 100::1 64:ff9b:2::1 2001::1 2001:1ff::1 2001:db8::1 \
                 2002:7f00:1::1 2002:808:808::1 3fff::1 3fff:fff::1 4000::1 5f00::1 ff02::1 ff0e::1 ::ffff:0.0.0.0 \
                 ::ffff:224.0.0.1 64:ff9b::255.255.255.255",
            ),
        ];
        for (expected, addresses) in table {
            for text in addresses.split_whitespace() {
                let address: IpAddr = text.parse().unwrap_or_else(|_| panic!("{text}"));
                assert_eq!(reach(address), expected, "{text}");
            }
        }
    }
}
