//! Real volumes. They are not part of the project; tests that need them are skipped, by name, without.

use std::path::{Path, PathBuf};

/// The file of a real volume: in `$VOLUMEPRO_DATA`, else in `../shared/data` beside the workspace. `None`, and a line
/// on standard error that names test and file, if it is not there.
#[must_use]
pub fn volume(test: &str, name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("VOLUMEPRO_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"), PathBuf::from);
    let path = folder.join(name);
    if path.is_file() {
        return Some(path);
    }
    eprintln!("SKIPPED {test}: {} is not there (set VOLUMEPRO_DATA)", path.display());
    None
}
