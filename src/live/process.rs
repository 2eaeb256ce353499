//! A process of a run: start, supervision and end. It does not outlive its parent.

use anyhow::Context;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use serde_json::{Value, json};
use signal_hook::consts::SIGTERM;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::Sender;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time for a process to end on SIGTERM before it is killed.
const TIME_TO_END: Duration = Duration::from_secs(2);
/// Time between two checks for its end.
const POLL: Duration = Duration::from_millis(10);

/// A line of the standard error of a process.
pub struct Line {
    /// Name of the process.
    pub process: &'static str,
    /// The line.
    pub text: String,
}

/// A process of a run.
pub struct Process {
    /// Role in the run.
    pub name: &'static str,
    child: Child,
    status: Option<ExitStatus>,
    result: Option<JoinHandle<String>>,
    json: Value,
}

impl Process {
    /// Starts this program with `arguments`; the lines of its standard error are sent to `lines`.
    pub fn start(name: &'static str, arguments: &[&OsStr], lines: Sender<Line>) -> anyhow::Result<Self> {
        let program = std::env::current_exe().context("the path of this program")?;
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // In its own process group, so that Ctrl-C reaches only the parent, which ends the processes in order.
        let mut child = command.process_group(0).spawn().with_context(|| format!("cannot start the {name} process"))?;
        let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
        let result = std::thread::spawn(move || {
            let mut text = String::new();
            // An unreadable result is reported as missing.
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

    /// Process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether [`Process::status`] has returned its end.
    pub fn has_ended(&self) -> bool {
        self.status.is_some()
    }

    /// Exit status; `None` while the process runs.
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

    /// Sends a signal that requests the end, unless the process has ended.
    pub fn request_end(&mut self, signal: i32) -> anyhow::Result<()> {
        if self.status()?.is_none() {
            let pid = Pid::from_raw(self.child.id().cast_signed());
            kill(pid, Signal::try_from(signal)?).with_context(|| self.name)?;
        }
        Ok(())
    }

    /// Kills the process.
    pub fn kill(&mut self) -> anyhow::Result<()> {
        self.child.kill().with_context(|| self.name)
    }

    /// Result as JSON: exit code or signal, and the JSON that the process printed.
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

    /// Whether it ended with exit code 0.
    pub fn is_good(&self) -> bool {
        self.status.is_some_and(|status| status.success())
    }

    /// Whether it ended with exit code 3, data loss.
    pub fn lost_data(&self) -> bool {
        self.status.is_some_and(|status| status.code() == Some(3))
    }
}

/// The process ends with its parent. Only after an error of the run; it gets time to complete its log or to damp the joints.
impl Drop for Process {
    fn drop(&mut self) {
        let begin = Instant::now();
        if self.request_end(SIGTERM).is_ok() {
            while begin.elapsed() < TIME_TO_END && matches!(self.child.try_wait(), Ok(None)) {
                std::thread::sleep(POLL);
            }
        }
        if self.status.is_none() {
            // Fails if the process has just ended.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}
