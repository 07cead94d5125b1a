//! The seccomp filters that the table of system calls becomes.

use std::collections::BTreeMap;

use seccompiler::{
    BpfProgram, Error, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
    SeccompRule, apply_filter,
};

use super::Mode;
use super::calls::{Call, GROUPS, Group, Only, Treatment};

/// Why there is no filter.
#[derive(Debug)]
pub(super) enum FilterError {
    /// The system does not take one.
    System(String),
    /// The table cannot be made into one.
    Table(String),
}

type Rules = BTreeMap<i64, Vec<SeccompRule>>;

/// Restricts the calling thread to the system calls of the table. `socket` says whether the process removes its
/// socket's path.
///
/// There are two filters, because one filter has one answer to what its rules match. The kernel takes the stricter
/// answer of the two.
pub(super) fn install(mode: Mode, socket: bool) -> Result<(), FilterError> {
    let missing = |group: &Group| group.treatment == Treatment::Missing;
    let allowed = |group: &Group| group.treatment != Treatment::AllowedWithSocket || socket;
    if mode == Mode::On {
        let absent = SeccompAction::Errno(libc::ENOSYS as u32);
        apply(rules(missing)?, SeccompAction::Allow, absent)?;
        return apply(rules(allowed)?, SeccompAction::Trap, SeccompAction::Allow);
    }
    apply(rules(allowed)?, SeccompAction::Log, SeccompAction::Allow)
}

fn apply(rules: Rules, otherwise: SeccompAction, matched: SeccompAction) -> Result<(), FilterError> {
    let table = |error: &dyn std::error::Error| FilterError::Table(error.to_string());
    let architecture = std::env::consts::ARCH.try_into().map_err(|error| table(&error))?;
    let filter =
        SeccompFilter::new(rules, otherwise, matched, architecture).map_err(|error| table(&error))?;
    let program: BpfProgram = filter.try_into().map_err(|error| table(&error))?;
    apply_filter(&program).map_err(|error| match error {
        Error::Prctl(reason) | Error::Seccomp(reason) => FilterError::System(reason.to_string()),
        error => FilterError::Table(error.to_string()),
    })
}

fn rules(which: impl Fn(&Group) -> bool) -> Result<Rules, FilterError> {
    let calls = GROUPS.iter().filter(|group| which(group)).flat_map(|group| group.calls);
    calls.map(|call| Ok((call.number, conditions(call)?))).collect()
}

/// One rule for each alternative, none where there is no condition.
fn conditions(call: &Call) -> Result<Vec<SeccompRule>, FilterError> {
    let rule = |only: &Only| {
        let (argument, mask, value) = match *only {
            Only::Bits { argument, mask, value } => (argument, mask, value),
            Only::ThisProcess => (0, u32::MAX, std::process::id()),
        };
        let operator = SeccompCmpOp::MaskedEq(mask.into());
        let length = SeccompCmpArgLen::Dword;
        let condition = SeccompCondition::new(argument, length, operator, value.into());
        condition.and_then(|condition| SeccompRule::new(vec![condition]))
    };
    let rules: Result<_, _> = call.only.iter().map(rule).collect();
    rules.map_err(|error| FilterError::Table(error.to_string()))
}
