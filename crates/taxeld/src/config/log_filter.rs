//! What is logged, in the words of `RUST_LOG`.

use tracing_subscriber::EnvFilter;

/// Before whatever filter there is: these libraries warn of each frame and connection that a client spoils, as often as it
/// likes. What the service itself says of that is bounded (`taxel-rpc/src/refusals.rs`). A filter that names them decides.
const LIBRARIES: &str = "h2=error,hyper=error,hyper_util=error,rustls=error,tonic=error,tower=error,";

/// The filter that a text is.
///
/// # Errors
/// What is wrong with the text.
pub fn log_filter(text: &str) -> Result<EnvFilter, String> {
    EnvFilter::try_new(text).map_err(|error| error.to_string())?; // of what was written alone
    EnvFilter::try_new(format!("{LIBRARIES}{text}")).map_err(|error| error.to_string())
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
}
