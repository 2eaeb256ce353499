//! A process of a run: started, watched, ended, and never left behind.

use anyhow::Context;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::{Value, json};
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::Sender;
use std::thread::JoinHandle;

/// A line that a process wrote on its standard error.
pub struct Line {
    /// Which process.
    pub process: &'static str,
    /// What.
    pub text: String,
}

/// A process of a run.
pub struct Process {
    /// Its part in the run.
    pub name: &'static str,
    child: Child,
    status: Option<ExitStatus>,
    result: Option<JoinHandle<String>>,
    json: Value,
}

impl Process {
    /// Starts this program with other arguments; lines of its standard error go to `lines`.
    pub fn start(name: &'static str, arguments: &[&OsStr], lines: Sender<Line>) -> anyhow::Result<Self> {
        let program = std::env::current_exe().context("the path of this program")?;
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // In a group of its own, so that Ctrl-C reaches this process alone, which ends the others in their order.
        let mut child = command.process_group(0).spawn().with_context(|| format!("{name} cannot be started"))?;
        let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
        let result = std::thread::spawn(move || {
            let mut text = String::new();
            // What cannot be read is no JSON, and is shown as missing.
            let _ = stdout.map(|mut stdout| stdout.read_to_string(&mut text));
            text
        });
        std::thread::spawn(move || {
            let Some(stderr) = stderr else { return };
            for text in BufReader::new(stderr).lines().map_while(Result::ok) {
                if lines.send(Line { process: name, text }).is_err() {
                    return;
                }
            }
        });
        Ok(Process { name, child, status: None, result: Some(result), json: Value::Null })
    }

    /// Number of the process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether [`Process::status`] has told that it ended.
    pub fn has_ended(&self) -> bool {
        self.status.is_some()
    }

    /// How it ended, if it has.
    pub fn status(&mut self) -> anyhow::Result<Option<ExitStatus>> {
        if self.status.is_none()
            && let Some(status) = self.child.try_wait().with_context(|| self.name)?
        {
            self.status = Some(status);
            let text = self.result.take().and_then(|result| result.join().ok()).unwrap_or_default();
            self.json = serde_json::from_str(&text).unwrap_or_default();
        }
        Ok(self.status)
    }

    /// Asks it to end, unless it has.
    pub fn ask_to_end(&mut self) -> anyhow::Result<()> {
        if self.status()?.is_none() {
            let pid = Pid::from_raw(self.child.id().cast_signed());
            kill(pid, Signal::SIGINT).with_context(|| self.name)?;
        }
        Ok(())
    }

    /// Kills it.
    pub fn kill(&mut self) -> anyhow::Result<()> {
        self.child.kill().with_context(|| self.name)
    }

    /// How it ended, as JSON: exit code or signal, and what it said itself.
    pub fn json(&self) -> Value {
        let mut value = json!({
            "pid": self.id(),
            "exit_code": self.status.and_then(|status| status.code()),
            "signal": self.status.and_then(|status| status.signal()),
        });
        if let (Value::Object(value), Value::Object(own)) = (&mut value, &self.json) {
            value.extend(own.clone());
        }
        value
    }

    /// It ended by itself and with a good exit code.
    pub fn is_good(&self) -> bool {
        self.status.is_some_and(|status| status.success())
    }

    /// It ended with data loss.
    pub fn lost_data(&self) -> bool {
        self.status.is_some_and(|status| status.code() == Some(3))
    }
}

/// Whatever happens to this process, the others end with it.
impl Drop for Process {
    fn drop(&mut self) {
        if self.status.is_none() {
            // It may have ended just now; then there is nothing to kill.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}
