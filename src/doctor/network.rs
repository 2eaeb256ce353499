//! Checks of the network for LCM: multicast route, loopback of datagrams, buffer sizes, firewall.

use super::Check;
use super::files::{CAP_NET_ADMIN, System};
use lcmtypes::bus::{Bus, LcmBus};
use nix::ifaddrs::getifaddrs;
use nix::net::if_::InterfaceFlags;
use replay::udpm::{Listener, Packet, Url, split};
use std::net::{IpAddr, Ipv4Addr, UdpSocket};
use std::process::Command;
use std::time::{Duration, Instant};

/// Channel of the test messages.
pub const CHANNEL: &str = "HOOF_DOCTOR";
/// Receive buffer that the recorder requests, bytes.
const RECORDER_BUFFER: i64 = 1 << 25;
/// Receive buffer for more than 0.1 s of a live run, bytes: a run file requests it, and stock tools should have it. The usual default of
/// 212,992 bytes holds 166 messages of 400 bytes (measured), which is 15 ms.
const TOOL_BUFFER: i64 = 2_000_000;
/// Number of test messages.
const TRIES: u32 = 100;
/// Time limit for the test messages.
const TEST_TIMEOUT: Duration = Duration::from_secs(1);
/// A message of more than one datagram, bytes.
const LONG: usize = 100_000;

/// An interface of this machine with an IPv4 address.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Interface {
    name: String,
    address: Ipv4Addr,
    is_loopback: bool,
    is_multicast: bool,
}

/// All checks of the network.
pub fn checks(system: &System, url: &Url) -> Vec<Check> {
    let interfaces = interfaces();
    let source_address = source_address(url);
    let has_route = source_address.is_ok();
    let mut checks = vec![route(url, source_address, &interfaces)];
    // Without a route the tests cannot run.
    if has_route {
        checks.push(loopback("datagrams", url, own_sockets(url)));
        checks.push(loopback("liblcm", url, through_liblcm(url)));
    }
    checks.push(between_machines(url, &interfaces));
    checks.push(recorder_buffer(system));
    checks.push(default_buffer(system));
    checks.push(fragments(system, url));
    checks.push(firewall(&[ask("nft", &["list", "ruleset"]), ask("iptables", &["-S", "INPUT"])].concat(), system));
    checks
}

fn interfaces() -> Vec<Interface> {
    let all = getifaddrs().into_iter().flatten();
    let up = all.filter(|interface| interface.flags.contains(InterfaceFlags::IFF_UP));
    up.filter_map(|interface| {
        Some(Interface {
            address: interface.address?.as_sockaddr_in()?.ip(),
            name: interface.interface_name,
            is_loopback: interface.flags.contains(InterfaceFlags::IFF_LOOPBACK),
            is_multicast: interface.flags.contains(InterfaceFlags::IFF_MULTICAST),
        })
    })
    .collect()
}

/// The source address of a datagram to the group.
fn source_address(url: &Url) -> Result<Ipv4Addr, String> {
    let ask = || -> std::io::Result<IpAddr> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        socket.connect((url.group, url.port))?;
        Ok(socket.local_addr()?.ip())
    };
    match ask() {
        Ok(IpAddr::V4(address)) => Ok(address),
        Ok(IpAddr::V6(address)) => Err(format!("{address} is not an IPv4 address")),
        Err(error) => Err(error.to_string()),
    }
}

fn route(url: &Url, source_address: Result<Ipv4Addr, String>, interfaces: &[Interface]) -> Check {
    const NAME: &str = "multicast route";
    let outside = interfaces.iter().find(|i| !i.is_loopback && i.is_multicast).map_or("eth0", |i| &*i.name);
    let wanted = if url.ttl == 0 { "lo" } else { outside };
    let fix = format!("sudo ip link set {wanted} up && sudo ip route replace 224.0.0.0/4 dev {wanted}");
    match source_address {
        Err(why) => Check::fail(NAME, format!("none to {}: {why}", url.group), fix),
        Ok(address) => {
            let interface = interfaces.iter().find(|interface| interface.address == address);
            let found = format!("{} uses {} ({address})", url.group, interface.map_or("?", |i| &*i.name));
            match interface {
                Some(i) if i.is_loopback && url.ttl > 0 => {
                    Check::fail(NAME, format!("{found}: loopback, but ttl={} is for other machines", url.ttl), fix)
                }
                Some(i) if !i.is_loopback && !i.is_multicast => Check::fail(
                    NAME,
                    format!("{found}, which has multicast disabled"),
                    format!("sudo ip link set {} multicast on", i.name),
                ),
                _ => Check::ok(NAME, found),
            }
        }
    }
}

/// Received and sent test messages.
type Loopback = Result<(usize, usize), String>;

fn loopback(name: &'static str, url: &Url, result: Loopback) -> Check {
    let accept = format!("sudo iptables -I INPUT -p udp --dport {} -d {} -j ACCEPT", url.port, url.group);
    match result {
        Err(why) => Check::fail(name, why, "see docs/multicast.md"),
        Ok((0, sent)) => Check::fail(name, format!("none of {sent} messages received: a filter drops them"), accept),
        Ok((came, sent)) if came < sent => {
            let found = format!("{came} of {sent} messages received");
            Check::warn(name, found, format!("sudo sysctl -w net.core.rmem_default={TOOL_BUFFER}"))
        }
        Ok((came, _)) => Check::ok(name, format!("all {came} messages received")),
    }
}

/// Test with our own sockets: short messages and one of several datagrams.
fn own_sockets(url: &Url) -> Loopback {
    let mut listener = Listener::open(url).map_err(|error| error.to_string())?;
    let send = || -> std::io::Result<usize> {
        let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0))?;
        socket.set_multicast_ttl_v4(0)?;
        let own = u64::from(std::process::id()).to_be_bytes();
        let short = (0..TRIES).flat_map(|number| split(number, CHANNEL, &own));
        let datagrams: Vec<Vec<u8>> = short.chain(split(TRIES, CHANNEL, &[0; LONG])).collect();
        for datagram in &datagrams {
            socket.send_to(datagram, (url.group, url.port))?;
        }
        Ok(datagrams.len())
    };
    let sent = send().map_err(|error| format!("sending to {}: {error}", url.group))?;
    let (mut came, began) = (0, Instant::now());
    while came < sent && began.elapsed() < TEST_TIMEOUT {
        let datagram = listener.receive().map_err(|error| error.to_string())?;
        came += usize::from(datagram.is_some_and(|datagram| is_ours(datagram.bytes)));
    }
    Ok((came, sent))
}

/// Whether a datagram is one of our test messages: a short one with our process id, or a fragment of a long one.
fn is_ours(datagram: &[u8]) -> bool {
    match Packet::parse(datagram) {
        Ok(Packet::Short(message)) => {
            message.channel == CHANNEL && message.data == u64::from(std::process::id()).to_be_bytes()
        }
        Ok(Packet::Fragment(fragment)) => fragment.size as usize == LONG,
        Err(_) => false,
    }
}

/// Test with liblcm.
fn through_liblcm(url: &Url) -> Loopback {
    let quiet = Url { ttl: 0, ..url.clone() };
    let run_test = || -> Result<(usize, usize), lcmtypes::bus::BusError> {
        let mut bus = LcmBus::open(&quiet.to_string())?;
        bus.subscribe(CHANNEL)?;
        let own = u64::from(std::process::id()).to_be_bytes();
        for _ in 0..TRIES {
            bus.publish(CHANNEL, &own)?;
        }
        let (mut came, began) = (0, Instant::now());
        while came < TRIES as usize && began.elapsed() < TEST_TIMEOUT {
            came += bus.handle(Duration::from_millis(50))?.iter().filter(|message| message.data == own).count();
        }
        Ok((came, TRIES as usize))
    };
    run_test().map_err(|error| error.to_string())
}

fn between_machines(url: &Url, interfaces: &[Interface]) -> Check {
    const NAME: &str = "between machines";
    let others: Vec<&str> = interfaces.iter().filter(|i| !i.is_loopback).map(|i| &*i.name).collect();
    match (url.ttl, &others[..]) {
        (0, _) => Check::ok(NAME, "ttl=0: messages stay on this machine (use ttl=1 to reach other machines)"),
        (_, []) => Check::fail(NAME, "no interface to another machine", "ip -br link; sudo ip link set INTERFACE up"),
        (ttl, [one]) => Check::ok(NAME, format!("ttl={ttl}, interface {one}: test it with hoof doctor --between")),
        (ttl, [first, ..]) => Check::warn(
            NAME,
            format!("ttl={ttl}, several interfaces: {}. Multicast uses only one of them", others.join(", ")),
            format!("sudo ip route replace 224.0.0.0/4 dev {first}   (the robot's interface)"),
        ),
    }
}

fn recorder_buffer(system: &System) -> Check {
    const NAME: &str = "largest buffer";
    let max = system.number("/proc/sys/net/core/rmem_max").unwrap_or(0);
    let found = format!("net.core.rmem_max is {max}");
    if max >= RECORDER_BUFFER {
        Check::ok(NAME, found)
    } else if max >= TOOL_BUFFER && system.is_capable(CAP_NET_ADMIN) {
        Check::ok(NAME, format!("{found}; this user may exceed it"))
    } else {
        let found = format!("{found}, the recorder requests {RECORDER_BUFFER}: messages of a burst may be lost");
        Check::warn(NAME, found, format!("sudo sysctl -w net.core.rmem_max={RECORDER_BUFFER}"))
    }
}

fn default_buffer(system: &System) -> Check {
    const NAME: &str = "default buffer";
    let default = system.number("/proc/sys/net/core/rmem_default").unwrap_or(0);
    let found = format!("net.core.rmem_default is {default}");
    if default >= TOOL_BUFFER {
        return Check::ok(NAME, found);
    }
    let found = format!("{found}: lcm-logger and lcm-spy use it and lose messages after a delay of 15 ms");
    Check::warn(NAME, found, format!("sudo sysctl -w net.core.rmem_default={TOOL_BUFFER}"))
}

fn fragments(system: &System, url: &Url) -> Check {
    const NAME: &str = "long messages";
    let memory = system.number("/proc/sys/net/ipv4/ipfrag_high_thresh").unwrap_or(0);
    let seconds = system.number("/proc/sys/net/ipv4/ipfrag_time").unwrap_or(0);
    let found = format!("net.ipv4.ipfrag_high_thresh is {memory}, ipfrag_time {seconds}");
    if memory < 4 << 20 {
        let found = format!("{found}: too small for several fragmented messages");
        return Check::warn(NAME, found, "sudo sysctl -w net.ipv4.ipfrag_high_thresh=16777216");
    }
    if url.ttl > 0 && seconds > 10 {
        let found = format!("{found}: an incomplete message occupies the buffer for {seconds} s");
        return Check::warn(NAME, found, "sudo sysctl -w net.ipv4.ipfrag_time=3");
    }
    Check::ok(NAME, found)
}

/// Output of a program; empty if it cannot run.
fn ask(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output().ok().filter(|output| output.status.success());
    output.map_or(String::new(), |output| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// `rules` as nft and iptables print them.
fn firewall(rules: &str, system: &System) -> Check {
    const NAME: &str = "firewall";
    let is_on = |line: &str| line.trim() == "ENABLED=yes";
    if system.text("/etc/ufw/ufw.conf").is_some_and(|text| text.lines().any(is_on)) {
        let fix = "sudo ufw allow in proto udp to 224.0.0.0/4";
        return Check::warn(NAME, "ufw is enabled and drops messages of other machines without a rule", fix);
    }
    let drops = rules.lines().any(|line| {
        let line = line.trim();
        line.starts_with("-P INPUT DROP") || line.contains("hook input") && line.contains("policy drop")
    });
    let accepts = rules.lines().any(|line| line.contains("224.0.0.0/4") && line.to_lowercase().contains("accept"));
    match (drops, accepts) {
        (true, false) => Check::warn(
            NAME,
            "the default policy is drop: messages of other machines may be dropped",
            "sudo iptables -I INPUT -p udp -d 224.0.0.0/4 -j ACCEPT   (nft: add rule inet filter input ip daddr 224.0.0.0/4 accept)",
        ),
        (true, true) => Check::ok(NAME, "a rule accepts 224.0.0.0/4"),
        (false, _) if rules.is_empty() && system.is_capable(CAP_NET_ADMIN) => {
            Check::ok(NAME, "no rules, or neither nft nor iptables is installed")
        }
        (false, _) if rules.is_empty() => Check::ok(NAME, "no rules visible (nft and iptables show them to root only)"),
        (false, _) => Check::ok(NAME, "the default policy is accept"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::super::files::tests::machine;
    use super::*;

    fn url(ttl: u8) -> Url {
        Url { ttl, ..Url::default() }
    }

    fn interface(name: &str, last: u8) -> Interface {
        let is_loopback = name == "lo";
        let address = Ipv4Addr::new(10, 0, 0, last);
        Interface { name: name.to_owned(), address, is_loopback, is_multicast: !is_loopback }
    }

    #[test]
    fn the_route_must_match_the_ttl() {
        let all = [interface("lo", 1), interface("wlan0", 2)];
        let of = |ttl, last: u8| route(&url(ttl), Ok(Ipv4Addr::new(10, 0, 0, last)), &all);
        assert!(of(0, 1).level == Level::Ok && of(0, 1).found.contains("lo (10.0.0.1)"), "{:?}", of(0, 1));
        assert_eq!((of(0, 2).level, of(1, 2).level, of(1, 1).level), (Level::Ok, Level::Ok, Level::Fail));
        assert_eq!(of(1, 1).fix.unwrap(), "sudo ip link set wlan0 up && sudo ip route replace 224.0.0.0/4 dev wlan0");
        let none = route(&url(0), Err("Network is unreachable (os error 101)".to_owned()), &all);
        assert_eq!(none.level, Level::Fail);
        assert_eq!(none.fix.unwrap(), "sudo ip link set lo up && sudo ip route replace 224.0.0.0/4 dev lo");
        let no_multicast = [Interface { is_multicast: false, ..interface("tun0", 3) }];
        let check = route(&url(1), Ok(Ipv4Addr::new(10, 0, 0, 3)), &no_multicast);
        assert_eq!(check.fix.as_deref(), Some("sudo ip link set tun0 multicast on"));
    }

    #[test]
    fn missing_test_messages_are_a_warning_or_failure() {
        let level = |result: Loopback| loopback("datagrams", &url(0), result).level;
        assert_eq!(
            [Ok((102, 102)), Ok((101, 102)), Ok((0, 102)), Err("no".to_owned())].map(level),
            [Level::Ok, Level::Warn, Level::Fail, Level::Fail]
        );
    }

    #[test]
    fn test_messages_are_received_on_this_machine() {
        // An unused port, because liblcm receives every group on its port.
        let port = 9000 + (std::process::id() % 900) as u16;
        let url = Url { port, ..Url::default() };
        assert_eq!(own_sockets(&url), Ok((102, 102)));
        assert_eq!(through_liblcm(&url), Ok((100, 100)));
    }

    #[test]
    fn several_interfaces_are_a_warning_if_messages_leave_the_machine() {
        let all = [interface("lo", 1), interface("eth0", 2), interface("wlan0", 3)];
        assert_eq!(between_machines(&url(0), &all).level, Level::Ok);
        let check = between_machines(&url(1), &all);
        assert!(check.level == Level::Warn && check.found.contains("eth0, wlan0"), "{check:?}");
        assert_eq!(between_machines(&url(1), &all[..2]).level, Level::Ok);
        assert_eq!(between_machines(&url(1), &all[..1]).level, Level::Fail);
    }

    #[test]
    fn buffer_sizes_are_checked() {
        let of = |max: &str, capabilities: &str| {
            let files = [("/proc/sys/net/core/rmem_max", max), ("/proc/self/status", capabilities)];
            recorder_buffer(&machine("rmem", &files))
        };
        assert_eq!(of("33554432", "").level, Level::Ok);
        assert_eq!(of("4194304", "CapEff:\t0000000000001000").level, Level::Ok);
        assert_eq!(of("212992", "CapEff:\t0000000000001000").level, Level::Warn, "other tools may not exceed rmem_max");
        assert_eq!(of("4194304", "").fix.unwrap(), "sudo sysctl -w net.core.rmem_max=33554432");
        let default =
            |text: &str| default_buffer(&machine("default", &[("/proc/sys/net/core/rmem_default", text)])).level;
        assert_eq!((default("212992"), default("2000000")), (Level::Warn, Level::Ok));
    }

    #[test]
    fn fragment_settings_are_checked() {
        let of = |ttl, memory: &str, seconds: &str| {
            let files =
                [("/proc/sys/net/ipv4/ipfrag_high_thresh", memory), ("/proc/sys/net/ipv4/ipfrag_time", seconds)];
            fragments(&machine("frag", &files), &url(ttl))
        };
        assert_eq!(of(0, "4194304", "30").level, Level::Ok);
        assert_eq!(of(1, "4194304", "30").fix.unwrap(), "sudo sysctl -w net.ipv4.ipfrag_time=3");
        assert_eq!(of(1, "4194304", "3").level, Level::Ok);
        assert_eq!(of(0, "262144", "3").fix.unwrap(), "sudo sysctl -w net.ipv4.ipfrag_high_thresh=16777216");
    }

    #[test]
    fn firewall_rules_are_parsed() {
        let here = machine("filter", &[]);
        let nft = "table inet filter {\n\tchain input {\n\t\ttype filter hook input priority filter; policy drop;\n";
        let level = |rules: &str| firewall(rules, &here).level;
        assert_eq!(level(nft), Level::Warn);
        assert_eq!(level(&format!("{nft}\t\tip daddr 224.0.0.0/4 accept\n")), Level::Ok);
        assert_eq!(level(&nft.replace("drop", "accept")), Level::Ok);
        assert_eq!(level("-P INPUT DROP\n"), Level::Warn);
        assert_eq!(level("-P INPUT DROP\n-A INPUT -d 224.0.0.0/4 -j ACCEPT\n"), Level::Ok);
        assert_eq!(level(""), Level::Ok);
        let ufw = machine("ufw", &[("/etc/ufw/ufw.conf", "# on\nENABLED=yes\n")]);
        assert!(firewall("", &ufw).fix.unwrap().starts_with("sudo ufw allow"));
    }
}
