//! Processes of a live run, whose words are read one by one, and who do not outlive their test.

use super::{Ran, command, ran};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, ChildStderr, Command, Output, Stdio};

/// A process whose words are read one by one. Whatever becomes of the test, it ends.
pub struct Talker {
    child: Child,
    stderr: BufReader<ChildStderr>,
    /// What it has said so far.
    pub said: String,
}

impl Talker {
    /// `hoof` with arguments that are split at blanks, as a process of this one: where the test program is killed, it ends too.
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

    /// Number of its process.
    pub fn id(&self) -> String {
        self.child.id().to_string()
    }

    /// Reads on until a line holds all of these words; gives that line.
    #[track_caller]
    pub fn hear(&mut self, words: &[&str]) -> String {
        loop {
            let mut line = String::new();
            assert!(self.stderr.read_line(&mut line).unwrap() > 0, "it ended without {words:?}: {}", self.said);
            self.said += &line;
            if words.iter().all(|word| line.contains(word)) {
                return line;
            }
        }
    }

    /// Number of a process of a run.
    pub fn process(&mut self, name: &str) -> String {
        let line = self.hear(&[name, ": process "]);
        line.trim_end().rsplit(' ').next().unwrap().to_owned()
    }

    /// Waits for its end, and the end of all that speak through it. Killed where no exit code is left, it fails the test.
    pub fn end(mut self) -> Ran {
        let status = self.wait();
        let mut stdout = Vec::new();
        self.child.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
        ran(Output { status, stdout, stderr: std::mem::take(&mut self.said).into_bytes() })
    }

    /// Waits until nobody speaks through it any more.
    pub fn wait(&mut self) -> std::process::ExitStatus {
        self.stderr.read_to_string(&mut self.said).unwrap();
        self.child.wait().unwrap()
    }

    /// Asks it to end with Ctrl-C.
    pub fn interrupt(&self) {
        kill("-INT", &self.id());
    }
}

/// Those that a run has started end with it.
impl Drop for Talker {
    fn drop(&mut self) {
        // It may have ended already, and be waited for: then there is nothing to kill.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal to a process.
pub fn kill(signal: &str, process: &str) {
    assert!(Command::new("kill").args([signal, process]).status().unwrap().success());
}
