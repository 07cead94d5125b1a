//! Guests with a card, as `qemu-config/run-guest` starts them.

use rustix::process::{Pid, Signal, kill_process, kill_process_group, test_kill_process_group};
use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

/// How long a guest may take. One takes five seconds on an idle machine.
const LIMIT: Duration = Duration::from_secs(150);

/// How long `run-guest` may take beyond that to clean up.
const GRACE: Duration = Duration::from_secs(20);

/// A program of `qemu-config`.
#[must_use]
pub fn program(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../qemu-config").join(name)
}

/// Whether guests can be run here. If not, a line on standard error names the test and says why; under continuous
/// integration (environment variable `CI`) it is an error.
///
/// # Errors
/// Guests cannot be run, but must.
pub fn available(test: &str) -> io::Result<bool> {
    static REASON: OnceLock<Option<String>> = OnceLock::new();
    let reason = REASON.get_or_init(|| {
        ["get-qemu", "build-guest"].into_iter().find_map(|name| {
            match Command::new(program(name)).stdin(Stdio::null()).output() {
                Ok(output) if output.status.success() => None,
                Ok(output) => Some(String::from_utf8_lossy(&output.stderr).trim().to_owned()),
                Err(error) => Some(format!("{name}: {error}")),
            }
        })
    });
    match reason {
        None => Ok(true),
        Some(reason) if std::env::var_os("CI").is_some() => Err(io::Error::other(reason.as_str())),
        Some(reason) => {
            // Not by a macro, whose output the test harness would keep back, and in one piece.
            io::stderr().write_all(format!("SKIPPED {test}: {reason}\n").as_bytes())?;
            Ok(false)
        }
    }
}

/// A changed copy of the machine that `run-guest` starts.
pub struct Machine(tempfile::NamedTempFile);

impl Machine {
    /// What `change` makes of the lines of `machine.args`; it may leave lines out.
    ///
    /// # Errors
    /// Nothing is changed, or files cannot be used.
    pub fn changed(change: impl Fn(&str) -> Option<String>) -> io::Result<Self> {
        let own = fs::read_to_string(program("machine.args"))?;
        let lines: Vec<_> = own.lines().filter_map(change).collect();
        if own.lines().eq(lines.iter().map(String::as_str)) {
            return Err(io::Error::other("machine.args: nothing to change"));
        }
        let copy = tempfile::NamedTempFile::new()?;
        fs::write(copy.path(), lines.join("\n"))?;
        Ok(Self(copy))
    }

    /// The file, for `--machine`.
    #[must_use]
    pub fn path(&self) -> &str {
        self.0.path().to_str().unwrap_or_default()
    }
}

/// What a stream of a program has brought so far.
#[derive(Clone, Default)]
struct Stream(Arc<Mutex<Vec<u8>>>);

impl Stream {
    fn of(mut pipe: impl Read + Send + 'static) -> Self {
        let stream = Self::default();
        let kept = stream.clone();
        thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(length @ 1..) = pipe.read(&mut buffer) {
                if let Ok(mut bytes) = kept.0.lock() {
                    bytes.extend(buffer.get(..length).unwrap_or_default());
                }
            }
        });
        stream
    }

    fn bytes(&self) -> Vec<u8> {
        self.0.lock().map(|bytes| bytes.clone()).unwrap_or_default()
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.bytes()).into_owned()
    }
}

/// A guest that runs. When dropped, all its processes are killed.
pub struct Guest {
    process: Child,
    folder: tempfile::TempDir,
    output: Stream,
    errors: Stream,
    begun: Instant,
}

/// A guest that has ended.
pub struct Ended {
    /// How `run-guest` has ended.
    pub status: ExitStatus,
    /// Its standard output.
    pub output: Vec<u8>,
    /// Its standard error.
    pub errors: String,
}

impl Ended {
    /// The standard output of a guest whose command has succeeded.
    ///
    /// # Errors
    /// It has not.
    pub fn success(self) -> io::Result<Vec<u8>> {
        if self.status.success() {
            return Ok(self.output);
        }
        let output = String::from_utf8_lossy(&self.output).into_owned();
        Err(io::Error::other(format!("{}\n{output}\n{}", self.status, self.errors)))
    }
}

impl Guest {
    /// Starts `run-guest` with these arguments in a process group and a folder for temporary files of its own.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let mut process = Command::new(program("run-guest"))
            .arg("--timeout")
            .arg(LIMIT.as_secs().to_string())
            .args(arguments)
            .env("TMPDIR", folder.path())
            .process_group(0)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()?;
        let no_stream = || io::Error::other("no stream");
        let output = Stream::of(process.stdout.take().ok_or_else(no_stream)?);
        let errors = Stream::of(process.stderr.take().ok_or_else(no_stream)?);
        Ok(Self { process, folder, output, errors, begun: Instant::now() })
    }

    /// What `run-guest` and QEMU have complained about so far.
    #[must_use]
    pub fn errors(&self) -> String {
        self.errors.text()
    }

    /// Waits until the guest has printed `text` so many times.
    ///
    /// # Errors
    /// It ends, or takes too long.
    pub fn wait_for(&mut self, text: &str, times: usize) -> io::Result<()> {
        self.wait_until(|guest| guest.output.text().matches(text).count() >= times)
    }

    /// Waits until something is the case while the guest runs.
    ///
    /// # Errors
    /// It ends, or takes too long.
    pub fn wait_until(&mut self, done: impl Fn(&Self) -> bool) -> io::Result<()> {
        while !done(self) {
            if self.process.try_wait()?.is_some() || self.begun.elapsed() > LIMIT + GRACE {
                let (output, errors) = (self.output.text(), self.errors.text());
                return Err(io::Error::other(format!("waited in vain\n{output}\n{errors}")));
            }
            thread::sleep(Duration::from_millis(2));
        }
        Ok(())
    }

    /// Sends `run-guest` a signal.
    ///
    /// # Errors
    /// It has ended.
    pub fn signal(&self, signal: Signal) -> io::Result<()> {
        Ok(kill_process(pid(self.process.id())?, signal)?)
    }

    /// Kills QEMU, and nothing else, without warning.
    ///
    /// # Errors
    /// There is none.
    pub fn kill_qemu(&self) -> io::Result<()> {
        for entry in fs::read_dir("/proc")?.flatten() {
            let Some(id) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
            let command = fs::read(entry.path().join("cmdline")).unwrap_or_default();
            let command = String::from_utf8_lossy(&command);
            let ours = command.contains(&*self.folder.path().to_string_lossy());
            if ours && command.contains("vfio-user-pci") && !command.starts_with("timeout") {
                return Ok(kill_process(pid(id)?, Signal::KILL)?);
            }
        }
        Err(io::Error::other("no QEMU"))
    }

    /// Waits for the end, and sees to it that no process and no file remain.
    ///
    /// # Errors
    /// It takes too long, or something remains.
    pub fn end(mut self) -> io::Result<Ended> {
        let status = loop {
            if let Some(status) = self.process.try_wait()? {
                break status;
            }
            if self.begun.elapsed() > LIMIT + GRACE {
                return Err(io::Error::other(format!("the guest does not end\n{}", self.errors.text())));
            }
            thread::sleep(Duration::from_millis(5));
        };
        if test_kill_process_group(pid(self.process.id())?).is_ok() {
            return Err(io::Error::other("a process has remained"));
        }
        if let Some(entry) = fs::read_dir(self.folder.path())?.next() {
            return Err(io::Error::other(format!("{} has remained", entry?.path().display())));
        }
        // No writer is left, so that the readers come to their ends.
        while Arc::strong_count(&self.output.0) + Arc::strong_count(&self.errors.0) > 2 {
            thread::sleep(Duration::from_millis(1));
        }
        Ok(Ended { status, output: self.output.bytes(), errors: self.errors.text() })
    }

    /// Runs a guest to its end.
    ///
    /// # Errors
    /// As [`Self::start`] and [`Self::end`].
    pub fn run<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> io::Result<Ended> {
        Self::start(arguments)?.end()
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        if let Ok(group) = pid(self.process.id()) {
            kill_process_group(group, Signal::KILL).ok();
        }
        self.process.wait().ok();
    }
}

fn pid(id: u32) -> io::Result<Pid> {
    i32::try_from(id).ok().and_then(Pid::from_raw).ok_or_else(|| io::Error::other("no such process"))
}
