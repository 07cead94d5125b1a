//! The programming manual and its generated parts, which stand between markers.

pub const MANUAL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../device/PROGRAMMING.md");

/// `manual` with `text` between the markers of `part`.
pub fn with_part(manual: &str, part: &str, text: &str) -> String {
    let [begin, end] = ["begin", "end"].map(|it| format!("<!-- {part}: {it} -->\n"));
    let (before, rest) = manual.split_once(&begin).expect("a marker");
    let (_, after) = rest.split_once(&end).expect("a marker");
    format!("{before}{begin}\n{}\n\n{end}{after}", text.trim_matches('\n'))
}

/// Fails if a part of the manual is stale, or writes it anew if `UPDATE_MANUAL` is set.
pub fn check(parts: &[(&str, String)]) {
    let manual = std::fs::read_to_string(MANUAL).unwrap();
    let current = parts.iter().fold(manual.clone(), |text, (part, new)| with_part(&text, part, new));
    if std::env::var_os("UPDATE_MANUAL").is_some() {
        // In one step, because other tests read it meanwhile.
        let new = format!("{MANUAL}.new");
        std::fs::write(&new, &current).unwrap();
        std::fs::rename(new, MANUAL).unwrap();
    } else {
        assert!(manual == current, "PROGRAMMING.md is stale: run this test with UPDATE_MANUAL=1");
    }
}
