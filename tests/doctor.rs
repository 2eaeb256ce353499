//! `hoof doctor` as a person runs it.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::network::url;
use common::{command, hoof, ran};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

#[test]
fn every_check_has_a_line_and_what_is_wrong_has_a_remedy() {
    let ran = hoof(&format!("doctor --json --lcm-url {}", url(0)));
    let json = ran.json();
    let checks = json["checks"].as_array().unwrap();
    let names: Vec<&str> = checks.iter().map(|check| check["name"].as_str().unwrap()).collect();
    for name in [
        "multicast route",
        "default buffer",
        "long messages",
        "firewall",
        "real-time scheduler",
        "locked memory",
        "MuJoCo",
    ] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    let level = |check: &serde_json::Value| check["level"].as_str().unwrap().to_owned();
    for check in checks {
        assert_eq!(check["mend"].is_string(), level(check) != "OK", "{check}");
    }
    // From worst to best.
    let has = |wanted: &str| checks.iter().any(|check| level(check) == wanted);
    let worst = ["FAIL", "WARN", "OK"].into_iter().find(|wanted| has(wanted)).unwrap();
    assert_eq!((json["worst"].as_str().unwrap(), ran.code), (worst, i32::from(worst == "FAIL")));
    // The live tests need a multicast route, so it must exist.
    let of = |name: &str| checks.iter().find(|check| check["name"] == name).unwrap();
    assert_eq!(level(of("multicast route")), "OK", "{}", of("multicast route"));
    assert_ne!(level(of("liblcm")), "FAIL", "{}", of("liblcm"));
}

#[test]
fn the_listener_counts_received_messages() {
    let url = url(1);
    let between = |side: &str| {
        let mut command = command();
        command.args(["doctor", "--json", "--between", side, "--lcm-url", &url]);
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    let mut listener = between("listen").args(["--seconds", "60"]).spawn().unwrap();
    let mut stderr = BufReader::new(listener.stderr.take().unwrap());
    let mut text = String::new();
    while !text.contains("udpm://") {
        assert!(stderr.read_line(&mut text).unwrap() > 0, "the listener ended: {text}");
    }
    ran(between("send").args(["--seconds", "1", "--rate", "300"]).output().unwrap()).exits(0);
    let listened = ran(listener.wait_with_output().unwrap());
    let json = listened.json();
    let number = |key: &str| json[key].as_u64().unwrap();
    assert_eq!((number("sent"), number("sent_long"), number("came_again")), (297, 3, 0));
    assert!(json["sender"].is_string());
    // On a busy machine messages may be lost; then the exit code is 1.
    assert_eq!(listened.code, i32::from(number("lost") + number("lost_long") > 0), "{json}");
}

#[test]
fn invalid_arguments_are_rejected() {
    for (arguments, wanted) in [
        ("--between send --rate 0", "--rate 0"),
        ("--between send --seconds -1", "-1"),
        ("--seconds 3", "--between <SIDE>"),
        ("--lcm-url memq://", "memq://"),
    ] {
        let ran = hoof(&format!("doctor {arguments}")).exits(2);
        assert!(ran.stderr.contains(wanted), "{arguments}: {}", ran.stderr);
    }
}
