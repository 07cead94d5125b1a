//! Why the command fails, and its exit code.

use crate::RenderError;
use crate::geometry::GeometryError;
use std::process::ExitCode;

/// Why the command ends without doing what it was asked to.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Bad arguments or input.
    #[error("{0}")]
    Input(String),
    /// A failure after valid input.
    #[error("{0}")]
    Failure(String),
}

impl Error {
    /// Bad arguments or input.
    pub fn input(what: impl ToString) -> Self {
        Self::Input(what.to_string())
    }

    /// A failure after valid input.
    pub fn failure(what: impl ToString) -> Self {
        Self::Failure(what.to_string())
    }

    /// 2 for input, 1 for failures.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Input(_) => ExitCode::from(2),
            Self::Failure(_) => ExitCode::from(1),
        }
    }
}

impl From<GeometryError> for Error {
    fn from(error: GeometryError) -> Self {
        Self::input(error)
    }
}

impl From<RenderError> for Error {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Geometry(error) => error.into(),
            RenderError::Driver(error) => Self::failure(error),
        }
    }
}
