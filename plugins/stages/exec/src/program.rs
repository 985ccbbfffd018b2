//! The options of a program, and its processes.

use crate::answer::Answer;
use crate::message::{self, Message};
use crate::process::{END, Failure, Process};
use parking_lot::{Condvar, Mutex};
use std::path::PathBuf;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use syntable_model::context::Workers;
use syntable_model::prelude::*;

/// A program that answers messages on its standard input. It runs with the permissions of the user, so a run starts it only with
/// `--allow-code`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// The program, or the script that the interpreter runs.
    #[schemars(extend("x-syntable-ref" = "program"))]
    pub file: AssetPath,
    /// The interpreter of a script with its arguments, such as `["python3"]`. Without it, the file itself is started.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub interpreter: Vec<String>,
    /// Arguments after the file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arguments: Vec<String>,
    /// Options of its own. The program gets them as JSON in its first message.
    #[serde(default, skip_serializing_if = "serde_json::Map::is_empty")]
    pub options: serde_json::Map<String, serde_json::Value>,
    /// Processes that work at once, each on views of its own.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 256))]
    pub processes: u32,
    /// Time for a process to start, s.
    #[serde(default = "a_minute")]
    #[schemars(range(min = 0.1, max = 86400.0))]
    pub start_s: f64,
    /// Time for the answer to a view, s.
    #[serde(default = "a_minute")]
    #[schemars(range(min = 0.1, max = 86400.0))]
    pub answer_s: f64,
    /// Number of new attempts at a view after a process ended or gave no answer in time.
    #[serde(default = "one")]
    #[schemars(range(max = 100))]
    pub restarts: u32,
}

fn one() -> u32 {
    1
}

fn a_minute() -> f64 {
    60.0
}

/// Number of the first message of a process.
const START_NUMBER: u64 = 0;

/// The processes of a program.
pub struct Processes {
    program: Program,
    /// The first message.
    greeting: Arc<Vec<u8>>,
    state: Mutex<State>,
    freed: Condvar,
    /// Number of the last message.
    last: AtomicU64,
}

#[derive(Default)]
struct State {
    /// Processes that wait for a message.
    idle: Vec<Process>,
    /// Processes that work or start.
    busy: u32,
}

impl Drop for Processes {
    fn drop(&mut self) {
        // All of them at once, since each may take its time.
        let mut idle = std::mem::take(&mut self.state.get_mut().idle);
        idle.iter_mut().for_each(Process::close);
        let until = Instant::now() + END;
        idle.into_iter().for_each(|process| process.wait(until));
    }
}

/// The right to use one process. Dropping it gives the right to the next view.
struct Permit<'p>(&'p Processes);

impl Drop for Permit<'_> {
    fn drop(&mut self) {
        self.0.state.lock().busy -= 1;
        self.0.freed.notify_one();
    }
}

impl Processes {
    /// The processes of a program that reads and provides these products. They start with the first message.
    ///
    /// # Errors
    /// If the first message cannot be encoded.
    pub fn new(program: Program, reads: &[String], provides: &[String]) -> Result<Self> {
        let greeting = Message::new("start")
            .numbered(START_NUMBER)
            .text("options", &serde_json::Value::from(program.options.clone()).to_string())
            .texts("reads", reads.iter().map(String::as_str))
            .texts("provides", provides.iter().map(String::as_str))
            .encode()?;
        Ok(Self {
            program,
            greeting: Arc::new(greeting),
            state: Mutex::default(),
            freed: Condvar::new(),
            last: AtomicU64::new(START_NUMBER),
        })
    }

    /// The answer to a message. Unwinds if the run was asked to stop.
    ///
    /// # Errors
    /// That no process answered, or the error in the answer.
    pub fn ask(&self, message: Message, workers: &dyn Workers, log: &dyn Log) -> Result<Answer> {
        let named = |error: Error| error.in_file(self.program.file.path());
        let number = 1 + self.last.fetch_add(1, Ordering::Relaxed);
        let _permit = self.permit(workers);
        // Views that wait do not hold their encoded messages.
        let message = Arc::new(message.numbered(number).encode()?);
        let mut restarts = 0;
        loop {
            let idle = if restarts == 0 { self.state.lock().idle.pop() } else { None };
            let process = idle.map_or_else(|| self.start(workers, log), Ok);
            let asked = process.and_then(|mut process| {
                let answer = process.ask(Arc::clone(&message), seconds(self.program.answer_s), workers)?;
                Ok((process, answer))
            });
            match asked {
                Ok((process, archive)) => {
                    // A process that answers wrongly gets no further message.
                    let answer = Answer::new(archive, number, self.program.file.path(), log)?;
                    self.state.lock().idle.push(process);
                    return Ok(answer);
                }
                Err(Failure::Broken(error)) if restarts < self.program.restarts => {
                    restarts += 1;
                    log.warn(&named(error).help("a new process tries the view again"));
                }
                Err(Failure::Broken(error) | Failure::Wrong(error)) => return Err(named(error)),
            }
        }
    }

    /// Waits until a process may work.
    fn permit(&self, workers: &dyn Workers) -> Permit<'_> {
        const POLL: Duration = Duration::from_millis(50);
        let mut state = self.state.lock();
        while state.busy >= self.program.processes {
            self.freed.wait_for(&mut state, POLL);
            // Unlocked, because `check_stop` may unwind.
            parking_lot::MutexGuard::unlocked(&mut state, || workers.check_stop());
        }
        state.busy += 1;
        Permit(self)
    }

    /// Starts a process, and waits for its first answer.
    fn start(&self, workers: &dyn Workers, log: &dyn Log) -> Result<Process, Failure> {
        let mut process =
            Process::start(&mut self.command()).map_err(|error| Failure::Wrong(self.unstarted(&error)))?;
        let answer = process.ask(Arc::clone(&self.greeting), seconds(self.program.start_s), workers);
        let answer = answer.map_err(|failure| match failure {
            Failure::Broken(error) => Failure::Broken(error.context("its start")),
            Failure::Wrong(error) => Failure::Wrong(error.context("its start")),
        })?;
        let answer = Answer::new(answer, START_NUMBER, self.program.file.path(), log);
        answer.and_then(|answer| answer.check_empty("start")).map_err(Failure::Wrong)?;
        Ok(process)
    }

    fn command(&self) -> Command {
        let Program { file, interpreter, arguments, .. } = &self.program;
        // A name without a folder is searched in the folders of commands.
        let path = match file.path().parent() {
            Some(folder) if folder.as_os_str().is_empty() => PathBuf::from(".").join(file.path()),
            _ => file.path().to_owned(),
        };
        let mut command = match interpreter.split_first() {
            Some((interpreter, more)) => {
                let mut command = Command::new(interpreter);
                command.args(more).arg(path);
                command
            }
            None => Command::new(path),
        };
        command.args(arguments);
        command
    }

    fn unstarted(&self, error: &std::io::Error) -> Error {
        let message = |what: &str| Error::new(format!("{what} cannot be started: {}", text(error)));
        match self.program.interpreter.first() {
            Some(interpreter) => message(&format!("the interpreter `{interpreter}`"))
                .help("install it, or change `program.interpreter`"),
            None => message("the program").help(
                "make it executable with a first line such as `#!/usr/bin/env python3`, or set `program.interpreter = [\"python3\"]`",
            ),
        }
    }
}

fn text(error: &std::io::Error) -> String {
    Error::io("", error).message().to_owned()
}

fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
}

/// Refuses names of arrays that messages have themselves.
///
/// # Errors
/// If a product has such a name.
pub fn check_names<'n>(option: &str, names: impl IntoIterator<Item = &'n str>) -> Result<(), ConfigError> {
    let is_taken = |name: &&str| name.starts_with(message::RESERVED) || *name == syntable_formats::npz_archive::IDS;
    match names.into_iter().find(is_taken) {
        Some(name) => Err(ConfigError::new(option, format!("`{name}` is a name that messages have themselves"))),
        None => Ok(()),
    }
}
