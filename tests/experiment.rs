//! `hoof experiment`: the list, a short experiment, a search for a limit.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{command, folder, hoof, ran};
use serde_json::{Value, json};

#[test]
fn the_list_contains_every_experiment_of_the_paper() {
    let list = hoof("experiment list --json").exits(0).json();
    let ids: Vec<&str> = list.as_array().unwrap().iter().map(|entry| entry["id"].as_str().unwrap()).collect();
    for number in 1..=12 {
        assert!(ids.contains(&format!("A{number}").as_str()), "{ids:?}");
    }
    let text = hoof("experiment list").exits(0).stdout;
    assert!(ids.iter().all(|id| text.contains(id)) && text.contains("anymal_b"), "{text}");
}

#[test]
fn the_error_about_an_unknown_experiment_lists_the_known_ones() {
    let error = hoof("experiment run A13").exits(2).stderr;
    assert!(["A13", "A1, A2, A3,", "limits_anymal_b", "all"].iter().all(|id| error.contains(id)), "{error}");
}

#[test]
fn an_experiment_prints_published_wanted_and_measured() {
    let out = folder("a10");
    let markdown = out.join("tables.md");
    let arguments = format!("experiment run a10 --out {} --markdown {}", out.display(), markdown.display());
    let text = hoof(&arguments).exits(0).stdout;
    assert!(text.contains("A10, hyq") && text.contains("A(17)"), "{text}");
    let page = std::fs::read_to_string(&markdown).unwrap();
    assert!(page.contains("| 3 of 3 |") && page.contains("| A(4)"), "{page}");

    let json = hoof(&format!("{arguments} --robot anymal_b --json")).exits(0).json();
    assert_eq!((&json["id"], &json["robot"], &json["pass"]), (&json!("A10"), &json!("anymal_b"), &json!(true)));
    let rows = json["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 3);
    for row in rows {
        assert_eq!((&row["wanted"], &row["pass"]), (&json!("<= 1.0e-8"), &json!(true)), "{row}");
        assert!(row["measured"].as_f64().unwrap() < 1e-8, "{row}");
    }
}

/// The robot survives a push of 0 N and falls at 2000 N; the search finds the limit between them. Every run is stored and replays.
#[test]
fn a_limit_is_found_by_bisection() {
    let out = folder("limit");
    let scenario = out.join("shove.toml");
    let text = "name = \"shove\"\nduration_s = 1.5\n[terrain]\nkind = \"flat\"\n[[operator]]\nt_s = 0.0\nmode = \"stand\"\n\
                [[push]]\nt_s = 0.5\nduration_s = 0.5\nforce_W = [0.0, 0.0, 0.0]\n";
    std::fs::write(&scenario, text).unwrap();
    let mut limit = command();
    limit.args(["experiment", "limit", "--key", "push[0].force_W[1]", "--from", "0", "--to", "2000", "--step", "500"]);
    limit.args(["--scenario".as_ref(), scenario.as_os_str(), "--out".as_ref(), out.as_os_str(), "--json".as_ref()]);
    let found: Value = ran(limit.output().unwrap()).exits(0).json();
    let limit = found["limit"].as_f64().unwrap();
    assert!((limit % 500.0).abs() < 1e-9 && (0.0..2000.0).contains(&limit), "{found}");
    for tried in found["tried"].as_array().unwrap() {
        let value = tried["value"].as_f64().unwrap();
        assert_eq!(tried["survived"], if value <= limit { 1.0 } else { 0.0 }, "{found}");
        let name = format!("shove_{value:.1}_0");
        assert!(std::fs::read_to_string(out.join(format!("{name}.toml"))).unwrap().contains(&format!("{value:.1}")));
        hoof(&format!("replay {}", out.join(format!("{name}.mcap")).display())).exits(0);
    }
    let key = hoof(&format!(
        "experiment limit --scenario {} --key push[3].t_s --from 0 --to 1 --step 1 --out {}",
        scenario.display(),
        out.display()
    ));
    assert!(key.exits(2).stderr.contains("push[3].t_s"));
}
