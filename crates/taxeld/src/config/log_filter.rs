//! What is logged, in the words of `RUST_LOG`.

use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Before whatever filter there is these say errors alone: they warn of each frame and connection that a client spoils, as often
/// as it likes. What the service itself says of that is bounded (`taxel-rpc/src/refusals.rs`). A filter that names them decides.
const LIBRARIES: [&str; 6] = ["h2", "hyper", "hyper_util", "rustls", "tonic", "tower"];

/// What the names of our own crates begin with.
const OURS: &str = "taxel";

const EXPECTED: &str =
    "expected off, error, warn, info, debug or trace, or targets with such levels, as in \"taxel_rpc=debug,info\"";

/// The filter that a text is. One without a word in it, and a word that is neither a level nor a target that there is, as a
/// level that is misspelt, would have nothing logged at all: both are refused.
///
/// # Errors
/// What is wrong with the text, and what was expected.
pub fn log_filter(text: &str) -> Result<EnvFilter, String> {
    let mut directives = text.split(',').filter(|directive| !directive.trim().is_empty()).peekable();
    if directives.peek().is_none() {
        return Err(format!("it is empty: {EXPECTED}"));
    }
    for directive in directives {
        if is_unknown(directive.trim()) {
            return Err(format!(
                "`{directive}` is no level and no target of ours, and that of a library needs one: {EXPECTED}"
            ));
        }
        EnvFilter::try_new(directive).map_err(|_| format!("`{directive}` is no filter: {EXPECTED}"))?;
    }
    let libraries: String = LIBRARIES.iter().map(|library| format!("{library}=error,")).collect();
    EnvFilter::try_new(format!("{libraries}{text}")).map_err(|error| error.to_string())
}

/// Whether a directive is a word alone, without a level or a span, that is neither a level nor a target that we know of.
fn is_unknown(directive: &str) -> bool {
    let target = directive.split("::").next().unwrap_or_default();
    let is_alone = !directive.contains(['=', '[']);
    is_alone && directive.parse::<LevelFilter>().is_err() && !target.starts_with(OURS) && !LIBRARIES.contains(&target)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_warn_of_nothing_unless_the_filter_names_them() {
        let shown = |text: &str| log_filter(text).unwrap().to_string();
        assert!(shown("info").contains("h2=error"));
        assert!(shown("h2=debug,info").contains("h2=debug"));
        assert!(!shown("h2=debug,info").contains("h2=error"));
        assert!(log_filter("zzz=nolevel").is_err());
    }

    #[test]
    fn a_word_that_would_silence_the_log_is_refused_with_what_was_expected() {
        for (text, wrong) in [
            ("wran", "`wran` is no level"),
            ("info,taxle_rpc", "`taxle_rpc` is no level"),
            ("", "it is empty"),
            (" , ", "it is empty"),
            ("warn,taxeld=nonsense[[", "`taxeld=nonsense[[` is no filter"),
            ("taxeld=wran", "`taxeld=wran` is no filter"),
        ] {
            let said = log_filter(text).unwrap_err();
            assert!(said.contains(wrong) && said.ends_with(EXPECTED), "{text:?}: {said}");
        }
        for text in ["WARN", "off", "4", "taxel_rpc", "taxeld::bus", "tonic,info", "mio=trace,", "[span]=info"] {
            assert!(log_filter(text).is_ok(), "{text:?}");
        }
    }
}
