//! Landlock: no files, no TCP, no abstract sockets, no signals to others.

use std::path::Path;

use landlock::{
    ABI, Access, AccessFs, AccessNet, CompatLevel, Compatible, LandlockStatus, RestrictionStatus, Ruleset,
    RulesetAttr, RulesetCreatedAttr, RulesetError, RulesetStatus, Scope, path_beneath_rules,
};

use super::Gap;

/// The version whose restrictions are asked for.
pub(super) const LATEST: u32 = ABI::V6 as u32;

/// Takes all files from the calling thread, but lets it delete files in `folder`. Returns what the kernel does not
/// restrict.
///
/// Landlock knows no permission to delete one certain file.
pub(super) fn restrict(folder: Option<&Path>) -> Option<Gap> {
    // The parent of a plain name is no path at all.
    let folder = folder.map(|folder| if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    match enforce(folder) {
        Ok(RestrictionStatus { ruleset: RulesetStatus::FullyEnforced, .. }) => None,
        Ok(RestrictionStatus { landlock: LandlockStatus::Available { effective_abi, .. }, .. }) => {
            Some(Gap::OldLandlock(effective_abi as u32))
        }
        Ok(status) => Some(Gap::Landlock(format!("{:?}", status.landlock))),
        Err(error) => Some(Gap::Landlock(error.to_string())),
    }
}

fn enforce(folder: Option<&Path>) -> Result<RestrictionStatus, RulesetError> {
    Ruleset::default()
        .set_compatibility(CompatLevel::BestEffort)
        .handle_access(AccessFs::from_all(ABI::V6))?
        .handle_access(AccessNet::from_all(ABI::V6))?
        .scope(Scope::from_all(ABI::V6))?
        .create()?
        .add_rules(path_beneath_rules(folder, AccessFs::RemoveFile))?
        .restrict_self()
}
