//! Numbers and names in messages.

/// A number in as few characters as it takes: with an exponent where its digits would be many.
pub(crate) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 || !magnitude.is_finite() || (1e-5..1e16).contains(&magnitude) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// Text in one line, safe to show on a terminal: characters that would end the line, move the cursor or turn the
/// direction of writing are escaped.
pub(crate) fn one_line(text: &str) -> String {
    let acts = |character: char| {
        character.is_control() || matches!(character, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    let mut line = String::with_capacity(text.len());
    for character in text.chars() {
        if acts(character) {
            line.extend(character.escape_default());
        } else {
            line.push(character);
        }
    }
    line
}

/// The beginning of a text of any length, in one line.
pub(crate) fn shorten(text: &str, characters: usize) -> String {
    match text.char_indices().nth(characters) {
        Some((end, _)) => one_line(&text[..end]) + "...",
        None => one_line(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (-2.5, "-2.5"),
            (123_456_789.0, "123456789"),
            (1e300, "1e300"),
            (-1.5e-200, "-1.5e-200"),
            (f64::NEG_INFINITY, "-inf"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn text_stays_in_its_line() {
        assert_eq!(
            one_line("a\nb\r\u{1b}[2J\u{7f}\u{9b}\u{202e}c"),
            "a\\nb\\r\\u{1b}[2J\\u{7f}\\u{9b}\\u{202e}c"
        );
        assert_eq!(one_line("größe 体.nrrd"), "größe 体.nrrd");
        assert_eq!(shorten("größe\n", 3), "grö...");
        assert_eq!(shorten("größe\n", 6), "größe\\n");
    }
}
