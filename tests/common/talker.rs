//! Processes of a live run: their standard error is read line by line, and they end with the test.

use super::{Ran, command, ran};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Output, Stdio};

/// A process whose standard error is read line by line. It is killed if the test fails.
pub struct Talker {
    child: Child,
    stderr: BufReader<ChildStderr>,
    /// Standard error so far.
    pub said: String,
}

impl Talker {
    /// `hoof` with arguments separated by spaces. It ends if the test program is killed.
    pub fn start(arguments: &str) -> Self {
        let mut command = command();
        command.args(arguments.split_whitespace()).args(["--parent", &std::process::id().to_string()]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        Talker { child, stderr, said: String::new() }
    }

    /// `hoof run` in simulation.
    pub fn run(url: &str, log: &Path, more: &str) -> Self {
        let simulation = "run runs/hyq_sim.toml --scenario scenarios/short_flat.toml --json";
        Talker::start(&format!("{simulation} --lcm-url {url} --log {} {more}", log.display()))
    }

    /// Process id.
    pub fn id(&self) -> String {
        self.child.id().to_string()
    }

    /// Reads until a line contains all of `words`; returns that line.
    #[track_caller]
    pub fn hear(&mut self, words: &[&str]) -> String {
        loop {
            let mut line = String::new();
            assert!(
                self.stderr.read_line(&mut line).unwrap() > 0,
                "the process ended without {words:?}: {}",
                self.said
            );
            self.said += &line;
            if words.iter().all(|word| line.contains(word)) {
                return line;
            }
        }
    }

    /// Process id of a process that `hoof run` has started.
    pub fn process(&mut self, name: &str) -> String {
        let line = self.hear(&[name, ": process "]);
        line.trim_end().rsplit(' ').next().unwrap().to_owned()
    }

    /// Waits until the process and all that share its standard error have ended. A process killed by a signal fails the test.
    pub fn end(mut self) -> Ran {
        let status = self.wait();
        let mut stdout = Vec::new();
        self.child.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
        ran(Output { status, stdout, stderr: std::mem::take(&mut self.said).into_bytes() })
    }

    /// Waits until its standard error is closed and the process has ended.
    pub fn wait(&mut self) -> std::process::ExitStatus {
        self.stderr.read_to_string(&mut self.said).unwrap();
        self.child.wait().unwrap()
    }

    /// Sends the signal of Ctrl-C.
    pub fn interrupt(&self) {
        kill("-INT", &self.id());
    }
}

/// Processes that a run has started end with it.
impl Drop for Talker {
    fn drop(&mut self) {
        // The process may have ended already: then both calls fail, which is fine.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal to a process.
pub fn kill(signal: &str, process: &str) {
    assert!(Command::new("kill").args([signal, process]).status().unwrap().success());
}
