//! `make install`, and the commands that README and docs print: the tour runs with the installed command alone, and every flag exists.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{folder, hoof, ran};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Installs the tested command below a new folder.
fn installed(test: &str) -> PathBuf {
    let prefix = folder(test);
    let install = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/install.sh");
    ran(Command::new(install).arg(env!("CARGO_BIN_EXE_hoof")).arg(&prefix).output().unwrap()).exits(0);
    prefix
}

/// The lines of all `sh` blocks of a page, without comments.
fn commands(page: &str) -> Vec<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(page)).unwrap();
    let blocks = text.split("```sh\n").skip(1).map(|rest| rest.split("```").next().unwrap());
    let lines = blocks.flat_map(str::lines).map(|line| line.split("  #").next().unwrap().trim().to_owned());
    lines.filter(|line| !line.is_empty() && !line.starts_with('#')).collect()
}

/// The library and the files of the installation are used, although the checkout exists: the installed scenario is shortened, and the run is short.
#[test]
fn the_installed_command_uses_the_installed_files() {
    let prefix = installed("files");
    let ldd = ran(Command::new("ldd").arg(prefix.join("bin/hoof")).output().unwrap()).exits(0).stdout;
    let library = ldd.lines().find(|line| line.contains("libmujoco")).unwrap();
    assert!(library.contains(prefix.to_str().unwrap()), "{library}");
    for file in [
        "share/man/man1/hoof.1",
        "share/man/man1/hoof-log-cat.1",
        "share/bash-completion/completions/hoof",
        "share/zsh/site-functions/_hoof",
        "share/fish/vendor_completions.d/hoof.fish",
        "share/hoofprint/robots/hyq/hyq.urdf",
        "share/hoofprint/gaits/pace.toml",
        "share/hoofprint/runs/hyq_sim.toml",
        "share/hoofprint/stacks/coman_hands.toml",
    ] {
        assert!(prefix.join(file).metadata().unwrap().len() > 0, "{file}");
    }

    let scenario = prefix.join("share/hoofprint/scenarios/short_flat.toml");
    let text = std::fs::read_to_string(&scenario).unwrap();
    assert!(text.contains("duration_s = 2.0"), "{text}");
    std::fs::write(&scenario, text.replace("duration_s = 2.0", "duration_s = 0.125")).unwrap();
    let elsewhere = folder("files_elsewhere");
    let sim = "sim --robot hyq --scenario scenarios/short_flat.toml --log run.mcap --json";
    let mut command = Command::new(prefix.join("bin/hoof"));
    command.args(sim.split(' ')).current_dir(&elsewhere).env_clear();
    assert_eq!(ran(command.output().unwrap()).exits(0).json()["ticks"], 125);
}

/// Every command of the README's tour as printed, in an empty folder, with an empty environment but for PATH. `hoof debug` gets `--once`, because it
/// needs a terminal; the live run needs a network and is the subject of `tests/live.rs`.
#[test]
fn the_tour_of_the_readme_runs_as_printed() {
    let prefix = installed("tour");
    let elsewhere = folder("tour_elsewhere");
    let path = format!("{}:/usr/bin:/bin", prefix.join("bin").display());
    let mut run = 0;
    for line in commands("README.md") {
        if !line.starts_with("hoof ") || line.starts_with("hoof run ") || line.contains("live.mcap") {
            continue;
        }
        let line = if line.starts_with("hoof debug ") { format!("{line} --once") } else { line };
        let mut shell = Command::new("sh");
        shell.args(["-c", &line]).current_dir(&elsewhere).env_clear().env("PATH", &path);
        let ran = ran(shell.output().unwrap());
        assert_eq!(ran.code, 0, "{line}\n{}", ran.stderr);
        run += 1;
    }
    assert!(run >= 10, "{run} commands");
}

/// Every subcommand and flag in the `sh` blocks of README and docs exists.
#[test]
fn the_commands_of_the_docs_exist() {
    let mut checked = 0;
    for page in ["README.md", "CONTRIBUTING.md"].into_iter().map(str::to_owned).chain(pages()) {
        for line in commands(&page) {
            let Some(at) = line.find("hoof ").filter(|at| *at == 0 || line[..*at].ends_with([' ', ';'])) else {
                continue;
            };
            let arguments: Vec<&str> =
                line[at..].split(['|', ';']).next().unwrap().split_whitespace().skip(1).collect();
            let subcommand = |word: &&&str| word.chars().all(|c| c.is_ascii_lowercase());
            let words: Vec<&str> = arguments.iter().take(2).take_while(subcommand).copied().collect();
            // The second word may be an argument, such as `hyq`.
            let helps = [words.join(" "), words[..1].join(" ")].map(|words| hoof(&format!("{words} --help")));
            let help = helps.iter().find(|ran| ran.code == 0).unwrap_or_else(|| panic!("{page}: {line}"));
            for flag in arguments.iter().filter(|argument| argument.starts_with("--")) {
                let flag = flag.split('=').next().unwrap();
                assert!(help.stdout.contains(flag), "{page}: {line}: no {flag}");
            }
            checked += 1;
        }
    }
    assert!(checked > 40, "{checked} commands");
}

/// Files that the pages name in backquotes or links exist: source files, folders, scripts, scenarios.
#[test]
fn the_files_that_the_docs_name_exist() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = std::fs::read_dir(top).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let folders: Vec<String> = folders.filter(|name| !name.starts_with(['.', 't']) || name == "tests").collect();
    let mut checked = 0;
    for page in ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].into_iter().map(str::to_owned).chain(pages()) {
        let text = std::fs::read_to_string(top.join(&page)).unwrap();
        for quoted in
            text.split('`').skip(1).step_by(2).filter(|quoted| !quoted.contains(['\n', ' ', '*', '{', 'N', '…']))
        {
            let name = quoted.trim_end_matches('/');
            let known = folders.iter().any(|folder| name == folder || name.starts_with(&format!("{folder}/")));
            if known && name.contains('/') {
                assert!(top.join(name).exists(), "{page}: `{quoted}` does not exist");
                checked += 1;
            }
        }
    }
    assert!(checked > 40, "{checked} names");
}

/// The pages in docs/, except those that tools write.
fn pages() -> impl Iterator<Item = String> {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let names = std::fs::read_dir(top).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.ends_with(".md") && name != "experiments.md").map(|name| format!("docs/{name}"))
}
