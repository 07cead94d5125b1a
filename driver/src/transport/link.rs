//! The thread that talks to a vfio-user server.
//!
//! The protocol client waits for each reply without an end. It stays on a thread of its own, and callers wait
//! for that thread no longer than they want. After an error or a missing reply nobody knows which reply belongs
//! to which request, so the connection is given up for good.

use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Duration;

use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, bounded, unbounded};
use vfio_user::Client;

use crate::Error;

type Job = Box<dyn FnOnce(&mut Client) + Send>;

/// The connection to a server.
#[derive(Debug)]
pub(super) struct Link {
    jobs: Sender<Job>,
    /// Why the connection was given up.
    death: Arc<OnceLock<String>>,
    timeout: Duration,
}

impl Link {
    /// Connects to the server at `path`. Neither this nor a later call lasts longer than `timeout`.
    ///
    /// The client cannot be interrupted: if the server accepts the connection and says nothing, the thread
    /// stays until the server closes it.
    pub(super) fn connect(path: &Path, timeout: Duration) -> Result<Self, Error> {
        let (jobs, queue) = unbounded();
        let (report, connected) = bounded(1);
        let death = Arc::new(OnceLock::new());
        let own = (path.to_owned(), Arc::clone(&death));
        thread::Builder::new()
            .name("vfio-user".into())
            .spawn(move || serve(&own.0, &report, &queue, &own.1))
            .map_err(|cause| Error::System { what: "starting the thread of the protocol client", cause })?;
        let cause = match connected.recv_timeout(timeout) {
            Ok(Ok(())) => return Ok(Self { jobs, death, timeout }),
            Ok(Err(vfio_user::Error::StreamRead(_))) => "turned away, perhaps for another client".into(),
            Ok(Err(error)) => error.to_string(),
            Err(RecvTimeoutError::Timeout) => format!("no answer within {timeout:?}"),
            Err(RecvTimeoutError::Disconnected) => "the server does not speak vfio-user".into(),
        };
        Err(Error::Connect { path: path.to_owned(), cause })
    }

    /// Has the client do `job`, which is named `what` in errors.
    pub(super) fn call<T: Send + 'static>(
        &self,
        what: &'static str,
        job: impl FnOnce(&mut Client) -> Result<T, vfio_user::Error> + Send + 'static,
    ) -> Result<T, Error> {
        if let Some(reason) = self.death.get() {
            return Err(Error::CardDead { reason: reason.clone() });
        }
        let (answer, answered) = bounded(1);
        let death = Arc::clone(&self.death);
        let job: Job = Box::new(move |client| {
            let result = job(client).map_err(|error| dead(&death, || format!("{what}: {error}")));
            // Whoever asked may have given up.
            answer.send(result).ok();
        });
        // If the thread has ended, the answer's channel is closed as well.
        self.jobs.send(job).ok();
        answered.recv_timeout(self.timeout).unwrap_or_else(|error| {
            Err(dead(&self.death, || match error {
                RecvTimeoutError::Timeout => format!("{what}: no answer within {:?}", self.timeout),
                RecvTimeoutError::Disconnected => format!("{what}: the protocol client has ended"),
            }))
        })
    }
}

/// Gives the connection up, if nobody has before.
fn dead(death: &OnceLock<String>, reason: impl FnOnce() -> String) -> Error {
    Error::CardDead { reason: death.get_or_init(reason).clone() }
}

fn serve(
    path: &Path,
    connected: &Sender<Result<(), vfio_user::Error>>,
    jobs: &Receiver<Job>,
    death: &OnceLock<String>,
) {
    let mut client = match Client::new(path) {
        Ok(client) => client,
        Err(error) => {
            connected.send(Err(error)).ok();
            return;
        }
    };
    if connected.send(Ok(())).is_err() {
        return;
    }
    for job in jobs {
        if death.get().is_none() {
            job(&mut client);
        }
        if death.get().is_some() {
            break;
        }
    }
}
