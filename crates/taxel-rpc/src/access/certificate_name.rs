//! The names of a certificate, by their kinds. A name is compared and shown with its kind, so that what one kind may contain
//! is never taken for a name of another.

use std::fmt;
use std::str::FromStr;

/// How a common name begins in text.
const COMMON_NAME: &str = "CN=";

/// How a DNS name begins in text.
const DNS: &str = "DNS:";

/// How a URI begins in text that would not be read as one without it.
const URI: &str = "URI:";

/// One name of a certificate.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CertificateName {
    /// The common name of the subject: `CN=ann` in text.
    Common(String),
    /// A DNS name of the subject alternative names: `DNS:robot.example` in text.
    Dns(String),
    /// A URI of the subject alternative names: itself in text, after `URI:` where that could be read as something else.
    Uri(String),
}

/// As configurations, logs and the audit log write it: no two names have the same text.
impl fmt::Display for CertificateName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Common(name) => write!(f, "{COMMON_NAME}{name}"),
            Self::Dns(name) => write!(f, "{DNS}{name}"),
            Self::Uri(uri) if is_plain(uri) => f.write_str(uri),
            Self::Uri(uri) => write!(f, "{URI}{uri}"),
        }
    }
}

impl FromStr for CertificateName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let after = |begin: &str| text.strip_prefix(begin).filter(|name| !name.is_empty()).map(str::to_owned);
        let plain = || is_plain(text).then(|| Self::Uri(text.to_owned()));
        let common = after(COMMON_NAME).map(Self::Common);
        let name = common.or_else(|| after(DNS).map(Self::Dns)).or_else(|| after(URI).map(Self::Uri)).or_else(plain);
        name.ok_or_else(|| {
            format!("\"{text}\": expected a URI, `DNS:...` or `CN=...`, or `URI:...` for any other text of a URI")
        })
    }
}

/// Whether a text can only be a URI: it begins with a scheme (RFC 3986 section 3.1) that is no word for a kind of names.
/// Authorities sign URIs without a scheme, too, such as `CN=ann`.
fn is_plain(uri: &str) -> bool {
    let Some((scheme, _)) = uri.split_once(':') else { return false };
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme && [DNS, URI].iter().all(|kind| !kind.trim_end_matches(':').eq_ignore_ascii_case(scheme))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXTS: [&str; 16] = [
        "boss",
        "CN=boss",
        "DNS:boss",
        "URI:boss",
        "dns:boss",
        "uri:boss",
        "Uri:URI:boss",
        "URI:CN=boss",
        "spiffe://robot/boss",
        "urn:boss",
        "CN=spiffe://robot/boss",
        "token boss",
        "uid 1000",
        "1x:boss",
        ":boss",
        "bo ss:1",
    ];

    #[test]
    fn no_two_names_have_the_same_text_and_a_text_is_read_as_the_name_that_it_shows() {
        let mut shown = std::collections::HashMap::new();
        for text in TEXTS {
            for kind in [CertificateName::Common, CertificateName::Dns, CertificateName::Uri] {
                let name = kind(text.to_owned());
                assert_eq!(name.to_string().parse(), Ok(name.clone()), "{name}");
                assert_eq!(shown.insert(name.to_string(), name.clone()), None, "{name}");
            }
        }
    }

    #[test]
    fn a_uri_is_written_as_it_is_unless_it_could_be_read_as_something_else() {
        let uri = |text: &str| CertificateName::Uri(text.to_owned()).to_string();
        for plain in ["spiffe://robot/boss", "urn:uuid:1", "https://x/CN=boss"] {
            assert_eq!(uri(plain), plain);
        }
        for other in ["CN=boss", "DNS:boss", "dNs:boss", "URI:boss", "token boss", "boss", "CN=a:b", ""] {
            assert_eq!(uri(other), format!("URI:{other}"));
        }
    }

    #[test]
    fn a_text_without_a_kind_or_a_name_is_refused() {
        for text in ["", "ann", "CN=", "DNS:", "URI:", "cn=ann", "dns:ann", "uri:ann", "token ann", "a b:c", "://x"] {
            let problem = text.parse::<CertificateName>().unwrap_err();
            assert!(problem.starts_with(&format!("\"{text}\": expected a URI, `DNS:...`")), "{problem}");
        }
    }
}
