//! What is logged, in the words of `RUST_LOG`.

use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;

/// Before whatever filter there is these say errors alone: they warn of each frame and connection that a client spoils, as often
/// as it likes. What the service itself says of that is bounded (`taxel-rpc/src/refusals.rs`). A filter that names them decides.
const LIBRARIES: [&str; 6] = ["h2", "hyper", "hyper_util", "rustls", "tonic", "tower"];

/// What the names of our own crates begin with.
const OURS: &str = "taxel";

/// The filter that a text is.
///
/// # Errors
/// What is wrong with the text, and what was expected.
pub fn log_filter(text: &str) -> Result<EnvFilter, String> {
    let is_level = |word: &str| {
        let is_word = !word.is_empty() && word.parse::<LevelFilter>().is_ok();
        is_word || word.contains(['=', '[']) || word.starts_with(OURS)
    };
    let libraries: String = LIBRARIES.iter().map(|library| format!("{library}=error,")).collect();
    let filter = EnvFilter::try_new(format!("{libraries}{text}")).ok();
    // A level that is misspelt is a target, and all else would not be logged.
    let is_known = text.split(',').map(str::trim).any(is_level);
    filter.filter(|_| is_known).ok_or_else(|| {
        "expected off, error, warn, info, debug or trace, or targets with such levels, as in \"taxel_rpc=debug,info\"".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_warn_of_nothing_unless_the_filter_names_them_and_what_is_no_level_is_refused() {
        let shown = |text: &str| log_filter(text).unwrap().to_string();
        assert!(shown("info").contains("h2=error"));
        assert!(shown("h2=debug,info").contains("h2=debug") && !shown("h2=debug,info").contains("h2=error"));
        for text in ["wran", "", " , ", "warn,taxeld=nonsense[[", "taxeld=wran"] {
            assert!(log_filter(text).is_err(), "{text:?}");
        }
        for text in ["WARN", "off", "4", "taxel_rpc", "taxeld::bus", "tonic,info", "mio=trace,", "[span]=info"] {
            assert!(log_filter(text).is_ok(), "{text:?}");
        }
    }
}
