//! The programs under test, as processes.

use std::fs;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// How long a program may take to do what a test waits for.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// Runs `volumepro` with these arguments to its end.
///
/// # Errors
/// The program cannot be run.
pub fn volumepro<S: AsRef<std::ffi::OsStr>>(program: &str, arguments: &[S]) -> io::Result<Output> {
    Command::new(program).args(arguments).stdin(Stdio::null()).output()
}

/// The picture that the card renders that `volumepro` carries inside itself.
///
/// # Errors
/// The program cannot be run, or fails.
pub fn embedded(program: &str, arguments: &[&str]) -> io::Result<Vec<u8>> {
    let folder = tempfile::tempdir()?;
    let output = folder.path().join("embedded.png");
    let output = output.as_os_str();
    let fixed = ["render".as_ref(), "--device".as_ref(), "embedded".as_ref(), "-o".as_ref(), output];
    let all: Vec<_> = fixed.into_iter().chain(arguments.iter().map(AsRef::as_ref)).collect();
    let result = volumepro(program, &all)?;
    if !result.status.success() {
        return Err(io::Error::other(String::from_utf8_lossy(&result.stderr)));
    }
    fs::read(output)
}

/// A device process that serves until it is dropped.
pub struct Device {
    process: Child,
    folder: tempfile::TempDir,
}

impl Device {
    /// Starts the device with further arguments and waits until it listens. It traces into [`Self::trace`].
    ///
    /// # Errors
    /// The process cannot be started, or does not say that it listens.
    pub fn start(program: &str, arguments: &[&str]) -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let mut process = Command::new(program)
            .arg("--socket")
            .arg(folder.path().join("card.sock"))
            .arg("--trace")
            .arg(folder.path().join("trace"))
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let output = process.stdout.take().ok_or_else(|| io::Error::other("no standard output"))?;
        let device = Self { process, folder };
        let (sender, receiver) = mpsc::channel();
        // The thread reads to the end, so that the process never waits for us.
        std::thread::spawn(move || {
            BufReader::new(output).lines().map_while(Result::ok).for_each(|line| {
                sender.send(line).ok();
            });
        });
        match receiver.recv_timeout(PATIENCE) {
            Ok(line) if line.contains("listening on") => Ok(device),
            other => Err(io::Error::other(format!("the device does not listen: {other:?}"))),
        }
    }

    /// The socket it listens on.
    #[must_use]
    pub fn socket(&self) -> PathBuf {
        self.folder.path().join("card.sock")
    }

    /// The value of `--device` for this device.
    #[must_use]
    pub fn selection(&self) -> String {
        format!("socket:{}", self.socket().display())
    }

    /// What it has traced so far.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn trace(&self) -> io::Result<String> {
        fs::read_to_string(self.folder.path().join("trace"))
    }

    /// Waits until the connection that began last has ended.
    ///
    /// # Errors
    /// It has not ended after [`PATIENCE`].
    pub fn wait_for_end(&self) -> io::Result<()> {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            let trace = self.trace()?;
            let [begins, ends] = ["begins", "ends:"].map(|word| {
                trace.lines().filter(|line| line.starts_with("connection") && line.contains(word)).count()
            });
            if begins == ends {
                return Ok(());
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Err(io::Error::other("a connection does not end"))
    }

    /// What the process holds of the system.
    ///
    /// # Errors
    /// It has ended.
    pub fn holdings(&self) -> io::Result<Holdings> {
        let process = Path::new("/proc").join(self.process.id().to_string());
        Ok(Holdings {
            descriptors: fs::read_dir(process.join("fd"))?.count(),
            mappings: fs::read_to_string(process.join("maps"))?
                .lines()
                .filter(|line| line.contains("memfd"))
                .count(),
            threads: fs::read_dir(process.join("task"))?.count(),
        })
    }

    /// What the process holds between clients: once that has not changed for a while.
    ///
    /// # Errors
    /// It has ended.
    pub fn holdings_at_rest(&self) -> io::Result<Holdings> {
        let mut last = self.holdings()?;
        let mut since = Instant::now();
        while since.elapsed() < Duration::from_millis(500) {
            std::thread::sleep(Duration::from_millis(10));
            let holdings = self.holdings()?;
            if holdings != last {
                (last, since) = (holdings, Instant::now());
            }
        }
        Ok(last)
    }

    /// What the process holds once that is `expected`, or what it still holds after a while: connections give back
    /// what they held only after they are traced as ended.
    ///
    /// # Errors
    /// It has ended.
    pub fn settled_holdings(&self, expected: Holdings) -> io::Result<Holdings> {
        let begun = Instant::now();
        loop {
            let holdings = self.holdings()?;
            if holdings == expected || begun.elapsed() > Duration::from_secs(5) {
                return Ok(holdings);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Whether the process still runs.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn is_alive(&mut self) -> io::Result<bool> {
        Ok(self.process.try_wait()?.is_none())
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

/// What a process holds of the system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holdings {
    /// Open descriptors.
    pub descriptors: usize,
    /// Mapped memory files.
    pub mappings: usize,
    /// Threads.
    pub threads: usize,
}
