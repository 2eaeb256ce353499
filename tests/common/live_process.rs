//! Processes of a live run. Their standard error is read line by line, and they end with their test.

use super::{Ran, command, ran};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Output, Stdio};

/// A process whose standard error is read line by line. It is killed when dropped.
pub struct LiveProcess {
    child: Child,
    stderr: BufReader<ChildStderr>,
    /// Standard error so far.
    pub stderr_text: String,
}

impl LiveProcess {
    /// Starts `hoof` with arguments that are split at blanks. With --parent it also ends if the test program is killed.
    pub fn start(arguments: &str) -> Self {
        let mut command = command();
        command.args(arguments.split_whitespace()).args(["--parent", &std::process::id().to_string()]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        LiveProcess { child, stderr, stderr_text: String::new() }
    }

    /// Starts `hoof run` in simulation.
    pub fn run(url: &str, log: &Path, more: &str) -> Self {
        let simulation = "run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --json";
        LiveProcess::start(&format!("{simulation} --lcm-url {url} --log {} {more}", log.display()))
    }

    /// Process id.
    pub fn id(&self) -> String {
        self.child.id().to_string()
    }

    /// Reads until a line contains all of these texts; returns that line.
    #[track_caller]
    pub fn wait_for(&mut self, texts: &[&str]) -> String {
        loop {
            let mut line = String::new();
            assert!(self.stderr.read_line(&mut line).unwrap() > 0, "no line with {texts:?}: {}", self.stderr_text);
            self.stderr_text += &line;
            if texts.iter().all(|text| line.contains(text)) {
                return line;
            }
        }
    }

    /// Process id of a process of the run.
    pub fn process(&mut self, name: &str) -> String {
        let line = self.wait_for(&[name, ": process "]);
        line.trim_end().rsplit(' ').next().unwrap().to_owned()
    }

    /// Waits for the end of the process and of all processes that write to its standard error. Fails the test if a signal killed it.
    pub fn end(mut self) -> Ran {
        let status = self.wait();
        let mut stdout = Vec::new();
        self.child.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
        ran(Output { status, stdout, stderr: std::mem::take(&mut self.stderr_text).into_bytes() })
    }

    /// Waits until its standard error is closed, and for its end.
    pub fn wait(&mut self) -> std::process::ExitStatus {
        self.stderr.read_to_string(&mut self.stderr_text).unwrap();
        self.child.wait().unwrap()
    }

    /// Sends SIGINT, as Ctrl-C does.
    pub fn interrupt(&self) {
        kill("-INT", &self.id());
    }
}

impl Drop for LiveProcess {
    fn drop(&mut self) {
        // Fails if the process has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Checks the exit code of the controller in the JSON of `hoof run`: 1 exactly if a fault damped the robot, such as an old joint state on a machine
/// that stalls.
#[allow(dead_code, reason = "not every test file runs a controller")]
pub fn assert_controller_ended(json: &serde_json::Value) {
    let controller = &json["controller"];
    assert_eq!(controller["exit_code"], i32::from(!controller["fault"].is_null()), "{controller}");
}

/// Sends a signal to a process.
pub fn kill(signal: &str, process: &str) {
    assert!(Command::new("kill").args([signal, process]).status().unwrap().success());
}
