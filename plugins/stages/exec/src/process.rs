//! One running process of a program.

use crate::message::{self, Unread};
use parking_lot::Mutex;
use std::collections::VecDeque;
use std::fmt;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::thread;
use std::time::{Duration, Instant};
use syntable_model::context::Workers;
use syntable_model::error::Error;

/// Interval between checks for a stop, while a process works.
const POLL: Duration = Duration::from_millis(50);
/// Time for a process to end after its output ended, and for its last words.
pub const END: Duration = Duration::from_millis(500);
/// Lines of standard error that errors show.
const LAST_LINES: usize = 12;
/// Most bytes of such a line.
const LINE_BYTES: u64 = 400;

/// A process that answers messages one after the other. Dropping it kills it.
pub struct Process {
    child: Child,
    /// None after the end of its messages.
    input: Option<Sender<Arc<Vec<u8>>>>,
    answers: Receiver<Result<Vec<u8>, Unread>>,
    last_lines: Arc<Mutex<VecDeque<String>>>,
    errors_ended: Receiver<()>,
    /// Its status, once [`end`](Self::end) was called.
    status: Option<Option<ExitStatus>>,
}

/// Why a process gave no answer.
pub enum Failure {
    /// Another process may do better: it ended, or was too slow.
    Broken(Error),
    /// It answers wrongly.
    Wrong(Error),
}

impl Process {
    /// Starts a process.
    ///
    /// # Errors
    /// The system's error.
    pub fn start(command: &mut Command) -> std::io::Result<Self> {
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // Ctrl-C goes to the whole group of the terminal, and a stage ends when the run ends it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(command, 0);
        let mut child = command.spawn()?;
        let missing = || std::io::Error::other("the process has no pipes");
        let (stdin, stdout) = (child.stdin.take().ok_or_else(missing)?, child.stdout.take().ok_or_else(missing)?);
        let stderr = child.stderr.take().ok_or_else(missing)?;
        let (input, messages) = channel();
        thread::spawn(move || write_all(stdin, &messages));
        // One answer waits at most: a program that prints more is not read further.
        let (answered, answers) = sync_channel(1);
        thread::spawn(move || {
            let mut output = BufReader::new(stdout);
            loop {
                let answer = message::read(&mut output);
                let is_last = answer.is_err();
                if answered.send(answer).is_err() || is_last {
                    return;
                }
            }
        });
        let last_lines = Arc::<Mutex<VecDeque<String>>>::default();
        let (ended, errors_ended) = channel();
        let lines = Arc::clone(&last_lines);
        thread::spawn(move || {
            keep_last_lines(BufReader::new(stderr), &lines);
            drop(ended);
        });
        Ok(Self { child, input: Some(input), answers, last_lines, errors_ended, status: None })
    }

    /// The archive of the answer to a message. After a failure, the process must be dropped.
    ///
    /// # Errors
    /// The reason for a missing answer. Unwinds if the run was asked to stop.
    pub fn ask(&mut self, message: Arc<Vec<u8>>, within: Duration, workers: &dyn Workers) -> Result<Vec<u8>, Failure> {
        let start = Instant::now();
        // If the process has ended, so has its output.
        let _ = self.input.as_ref().map(|input| input.send(message));
        loop {
            workers.check_stop();
            let left = within.saturating_sub(start.elapsed());
            match self.answers.recv_timeout(left.min(POLL)) {
                Ok(Ok(archive)) => return Ok(archive),
                Ok(Err(Unread::Wrong(error))) => return Err(Failure::Wrong(self.with_last_lines(error))),
                Ok(Err(Unread::Ended)) | Err(RecvTimeoutError::Disconnected) => {
                    return Err(Failure::Broken(self.failure()));
                }
                Err(RecvTimeoutError::Timeout) if left.is_zero() => {
                    let message = format!("it gave no answer within {} s", within.as_secs_f64());
                    let help = "allow more time in `program.answer_s` or `program.start_s`";
                    return Err(Failure::Broken(self.with_last_lines(Error::new(message).help(help))));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Ends its messages, so that it ends itself.
    pub fn close(&mut self) {
        self.input = None;
    }

    /// Gives it until a moment to end itself.
    pub fn wait(mut self, until: Instant) {
        self.ends_within(until.saturating_duration_since(Instant::now()));
    }

    /// Whether it ends within a time.
    fn ends_within(&mut self, within: Duration) -> bool {
        let start = Instant::now();
        while !self.has_ended() {
            if start.elapsed() > within {
                return false;
            }
            thread::sleep(Duration::from_millis(2));
        }
        true
    }

    /// Whether it has ended. It keeps its number, also the number of its group, until [`end`](Self::end).
    #[cfg(unix)]
    fn has_ended(&mut self) -> bool {
        use rustix::process::{WaitId, WaitIdOptions, waitid};
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        self.group().is_some_and(|child| matches!(waitid(WaitId::Pid(child), options), Ok(Some(_))))
    }

    /// Whether it has ended.
    #[cfg(not(unix))]
    fn has_ended(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(Some(_)))
    }

    /// Its group: the program, and programs that it started, such as an interpreter behind a shell.
    #[cfg(unix)]
    fn group(&self) -> Option<rustix::process::Pid> {
        i32::try_from(self.child.id()).ok().and_then(rustix::process::Pid::from_raw)
    }

    /// Ends it and its group. Returns its status.
    fn end(&mut self) -> Option<ExitStatus> {
        if let Some(status) = self.status {
            // Its number may belong to another process by now.
            return status;
        }
        #[cfg(unix)]
        if let Some(group) = self.group() {
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
        }
        let _ = self.child.kill();
        *self.status.insert(self.child.wait().ok())
    }

    /// The error of a process whose output has ended.
    fn failure(&mut self) -> Error {
        let status = if self.ends_within(END) { self.end() } else { None };
        let _ = self.errors_ended.recv_timeout(END);
        let message = match status {
            Some(status) => format!("it ended {} without an answer", Ended(status)),
            None => "it closed its standard output without an answer".to_owned(),
        };
        self.with_last_lines(Error::new(message))
    }

    /// Adds the last lines of standard error.
    fn with_last_lines(&self, error: Error) -> Error {
        let lines = self.last_lines.lock();
        if lines.is_empty() {
            return error;
        }
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        let message = format!("{}; it printed: {}", error.message(), lines.join("\n"));
        let help = error.help_text().map(str::to_owned);
        help.into_iter().fold(Error::new(message), Error::help)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
    }
}

/// How a process ended, for messages.
struct Ended(ExitStatus);

impl fmt::Display for Ended {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        #[cfg(unix)]
        if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&self.0) {
            return write!(f, "by signal {signal}");
        }
        match self.0.code() {
            Some(code) => write!(f, "with status {code}"),
            None => f.write_str("without a status"),
        }
    }
}

fn write_all(mut input: ChildStdin, messages: &Receiver<Arc<Vec<u8>>>) {
    for message in messages {
        if input.write_all(&message).and_then(|()| input.flush()).is_err() {
            return;
        }
    }
}

fn keep_last_lines(mut errors: impl BufRead, lines: &Mutex<VecDeque<String>>) {
    loop {
        let mut line = Vec::new();
        match errors.by_ref().take(LINE_BYTES).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let line = String::from_utf8_lossy(&line).trim_end().to_owned();
        let mut lines = lines.lock();
        if lines.len() == LAST_LINES {
            lines.pop_front();
        }
        lines.push_back(line);
    }
}
