//! Rust text cut into the tokens that paths are made of.

/// A word, `::` or a single sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Token<'a> {
    /// As it is written.
    pub text: &'a str,
    /// Line in the file, from 1.
    pub line: usize,
}

/// Whether a token is a name or a keyword.
pub fn is_word(text: &str) -> bool {
    text.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

fn in_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Bytes up to and with `end`, or all of the text.
fn up_to(text: &str, end: &str) -> usize {
    text.find(end).map_or(text.len(), |at| at + end.len())
}

/// Bytes of a comment that may hold others.
fn block_comment(text: &str) -> usize {
    let (mut at, mut depth) = (2, 1);
    while depth > 0 && at < text.len() {
        let rest = &text[at..];
        let open = rest.find("/*").unwrap_or(rest.len());
        let close = rest.find("*/").unwrap_or(rest.len());
        depth = if open < close { depth + 1 } else { depth - 1 };
        at += open.min(close) + 2;
    }
    at.min(text.len())
}

/// Bytes of a string or character literal that begins with the sign `end`.
fn quoted(text: &str, end: char) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            c if c == end => return at + c.len_utf8(),
            _ => {}
        }
    }
    text.len()
}

/// Bytes of a character literal, or of the sign alone where a lifetime or a label begins.
fn tick(text: &str) -> usize {
    let mut next = text.chars().skip(1);
    match (next.next(), next.next()) {
        (Some('\\'), _) | (Some(_), Some('\'')) => quoted(text, '\''),
        _ => 1,
    }
}

/// Bytes of the raw string that begins after the word `r`, `br` or `cr`, if there is one.
fn raw_string(text: &str) -> Option<usize> {
    let hashes = text.len() - text.trim_start_matches('#').len();
    let inside = text[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    Some(hashes + 1 + up_to(inside, &end))
}

/// Whether a string literal is a path: attributes such as serde's name functions in this way.
fn is_path(literal: &str) -> bool {
    literal.contains("::") && literal.chars().all(|c| in_word(c) || c == ':')
}

/// All tokens of a text without its comments and literals; a string that is a path counts as one.
pub fn tokens(text: &str) -> Vec<Token<'_>> {
    let (mut found, mut at, mut line) = (Vec::new(), 0, 1);
    while let Some(c) = text[at..].chars().next() {
        let rest = &text[at..];
        let mut kept = false;
        let length = match c {
            _ if rest.starts_with("//") => up_to(rest, "\n"),
            _ if rest.starts_with("/*") => block_comment(rest),
            _ if rest.starts_with("::") => {
                kept = true;
                2
            }
            '"' => quoted(rest, '"'),
            '\'' => tick(rest),
            c if in_word(c) => {
                let word = rest.find(|c| !in_word(c)).unwrap_or(rest.len());
                let raw = if ["r", "br", "cr"].contains(&&rest[..word]) { raw_string(&rest[word..]) } else { None };
                kept = raw.is_none();
                word + raw.unwrap_or(0)
            }
            c => {
                kept = !c.is_whitespace();
                c.len_utf8()
            }
        };
        let taken = &rest[..length];
        let literal = taken.trim_matches('"');
        if kept {
            found.push(Token { text: taken, line });
        } else if c == '"' && is_path(literal) {
            found.extend(tokens(literal).into_iter().map(|token| Token { line, ..token }));
        }
        line += taken.matches('\n').count();
        at += length;
    }
    found
}

/// The place after the item that begins at `at`: after its `;`, or after its braces.
fn after_item(tokens: &[Token<'_>], at: usize) -> usize {
    let mut depth = 0_usize;
    for (index, token) in tokens.iter().enumerate().skip(at) {
        match token.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" => depth = depth.saturating_sub(1),
            "}" if depth <= 1 => return index + 1,
            "}" => depth -= 1,
            ";" if depth == 0 => return index + 1,
            _ => {}
        }
    }
    tokens.len()
}

/// The tokens without those of the items that only tests have.
pub fn without_tests(tokens: Vec<Token<'_>>) -> Vec<Token<'_>> {
    let (mut live, mut at) = (Vec::with_capacity(tokens.len()), 0);
    let begins = |at: usize, mark: &[&str]| {
        let place = tokens.get(at..at + mark.len());
        place.is_some_and(|place| place.iter().map(|token| token.text).eq(mark.iter().copied()))
    };
    while at < tokens.len() {
        let test = ["#", "[", "cfg", "(", "test", ")", "]"];
        let more = ["#", "[", "cfg", "(", "all", "(", "test"];
        if begins(at, &test) || begins(at, &more) {
            at = after_item(&tokens, at);
        } else {
            live.push(tokens[at]);
            at += 1;
        }
    }
    live
}

#[test]
fn comments_and_literals_are_no_tokens() {
    let text = r##"a::b /* c /* d */ e */ "f" // g
        'h' '\'' 'i: r#"j " k"# b"l\"m" n"##;
    let words: Vec<&str> = tokens(text).iter().map(|token| token.text).collect();
    assert_eq!(words, ["a", "::", "b", "i", ":", "b", "n"]);
    assert_eq!(tokens(text).last().unwrap().line, 2);
}

#[test]
fn what_only_tests_have_is_left_out() {
    let text = "a; #[cfg(test)] #[allow(x)] mod tests { fn f(x: [u8; 2]) {} } b; \
                #[cfg(test)] mod c; #[cfg(not(test))] d; #[cfg(test)] fn f(x: [u8; 2]) { { } } e";
    let live: Vec<&str> = without_tests(tokens(text)).iter().map(|token| token.text).collect();
    assert_eq!(live.join(" "), "a ; b ; # [ cfg ( not ( test ) ) ] d ; e");
}
