//! The way to a daemon: its address, what is shown there, and a connection that keeps little of a stream.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use thiserror::Error;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
#[cfg(feature = "tls")]
use tonic::transport::{Certificate, ClientTlsConfig, Identity};
use tonic::transport::{Channel, Endpoint};
use tonic::{Request, Status};

/// A daemon that does not accept a connection within this time is told as not reached.
const CONNECT_WITHIN: Duration = Duration::from_secs(2);
/// A ping goes out after so long a silence, and its answer is waited for as long, so that a robot that lost its power is
/// noticed.
const KEEPALIVE_EVERY: Duration = Duration::from_secs(2);
/// Small HTTP/2 windows: what is not read yet waits at the daemon, which replaces it by newer samples.
const WINDOW_BYTES: u32 = 4 << 10;

/// The socket of a daemon of this machine, on which it knows who asks.
const SOCKET: &str = "/run/taxeld/taxeld.sock";
/// Without that socket.
const LOOPBACK: &str = "http://127.0.0.1:50051";

/// Where a daemon listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address(String);

/// An address that is none.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("`{0}`: expected http://HOST:PORT, HOST:PORT, unix:PATH or, with TLS, https://HOST:PORT")]
pub struct BadAddress(String);

impl Address {
    /// Reads `http://HOST:PORT`, `HOST:PORT`, `unix:PATH`, or `https://HOST:PORT` where this build has TLS.
    ///
    /// # Errors
    /// [`BadAddress`] with what was expected.
    pub fn parse(text: &str) -> Result<Self, BadAddress> {
        let bad = || BadAddress(text.to_owned());
        let address = match text.split_once(':') {
            Some(("unix", path)) if !path.trim_start_matches('/').is_empty() => text.to_owned(),
            Some(("http", rest)) if rest.starts_with("//") => text.to_owned(),
            Some(("https", rest)) if rest.starts_with("//") && cfg!(feature = "tls") => text.to_owned(),
            Some(("unix" | "http" | "https", _)) | None => return Err(bad()),
            Some((_, rest)) if rest.starts_with("//") => return Err(bad()),
            Some(_) => format!("http://{text}"),
        };
        let endpoint = Endpoint::from_shared(address.clone()).map_err(|_| bad())?;
        // A port that is none, 70000 say, is not read as one.
        if !address.starts_with("unix:") && endpoint.uri().port_u16().is_none() {
            return Err(bad());
        }
        Ok(Self(address))
    }

    /// The daemon of this machine: its Unix socket if there is one, else loopback TCP.
    #[must_use]
    pub fn local() -> Self {
        Self(if Path::new(SOCKET).exists() { format!("unix:{SOCKET}") } else { LOOPBACK.to_owned() })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// What a TLS listener is proven by, and what this client shows there. PEM.
#[cfg(feature = "tls")]
#[derive(Clone, Debug)]
pub struct TlsOptions {
    /// The authority of the daemon's certificate.
    pub authority: String,
    /// This client's certificate.
    pub certificate: String,
    /// Its key.
    pub key: String,
    /// The name in the daemon's certificate, where it is not the address's host.
    pub name: Option<String>,
}

#[cfg(feature = "tls")]
impl TlsOptions {
    /// What the files `ca.pem`, `client.pem` and `client.key` of this folder hold, for a daemon of this name.
    ///
    /// # Errors
    /// [`ConnectError::Certificate`]: the file that cannot be read, and why.
    pub fn in_folder(folder: &Path, name: Option<String>) -> Result<Self, ConnectError> {
        let text = |file: &str| {
            let file = folder.join(file);
            read_short(&file).map_err(|error| ConnectError::Certificate { file, cause: error.to_string() })
        };
        Ok(Self { authority: text("ca.pem")?, certificate: text("client.pem")?, key: text("client.key")?, name })
    }

    fn config(&self) -> ClientTlsConfig {
        let config = ClientTlsConfig::new()
            .ca_certificate(Certificate::from_pem(&self.authority))
            .identity(Identity::from_pem(&self.certificate, &self.key));
        match &self.name {
            Some(name) => config.domain_name(name),
            None => config,
        }
    }
}

/// Which force, and what makes it one.
#[derive(Clone, Debug)]
pub struct Options {
    /// Where the daemon listens.
    pub address: Address,
    /// The patch; empty for the only one.
    pub patch: String,
    /// Samples per second, 1 to 1000; absent: each as it comes.
    pub rate_hz: Option<f64>,
    /// The caller's own limit of age, if it has a stricter one than the daemon's (`max_age_s` of the sample).
    pub age_max: Option<Duration>,
    /// File whose first line is a token to show.
    pub token: Option<PathBuf>,
    /// Certificates, for `https://`.
    #[cfg(feature = "tls")]
    pub tls: Option<TlsOptions>,
}

impl Options {
    /// Each new sample of the only patch, as old as the daemon allows.
    #[must_use]
    pub fn new(address: Address) -> Self {
        Self {
            address,
            patch: String::new(),
            rate_hz: None,
            age_max: None,
            token: None,
            #[cfg(feature = "tls")]
            tls: None,
        }
    }

    /// Connects.
    ///
    /// # Errors
    /// [`ConnectError`]: a token or certificates that cannot be used, or nobody answers.
    pub async fn connect(&self) -> Result<Line, ConnectError> {
        let (endpoint, credential) = self.endpoint()?;
        let channel = endpoint.connect().await.map_err(|error| self.unreached(&error))?;
        Ok(InterceptedService::new(channel, credential))
    }

    /// A connection that is made when the first call needs it, and anew after it broke; needs a running runtime.
    ///
    /// # Errors
    /// [`ConnectError`]: a token or certificates that cannot be used.
    pub fn connect_lazy(&self) -> Result<Line, ConnectError> {
        let (endpoint, credential) = self.endpoint()?;
        Ok(InterceptedService::new(endpoint.connect_lazy(), credential))
    }

    fn endpoint(&self) -> Result<(Endpoint, Credential), ConnectError> {
        let credential = Credential::read(self.token.as_deref())?;
        let endpoint = Endpoint::from_shared(self.address.0.clone()).map_err(|error| self.unreached(&error))?;
        #[cfg(feature = "tls")]
        let endpoint = match &self.tls {
            Some(tls) => endpoint.tls_config(tls.config()).map_err(|error| self.unreached(&error))?,
            None => endpoint,
        };
        let endpoint = endpoint
            .connect_timeout(CONNECT_WITHIN)
            .initial_stream_window_size(WINDOW_BYTES)
            .http2_keep_alive_interval(KEEPALIVE_EVERY)
            .keep_alive_timeout(KEEPALIVE_EVERY)
            .keep_alive_while_idle(true);
        Ok((endpoint, credential))
    }

    fn unreached(&self, error: &dyn std::error::Error) -> ConnectError {
        ConnectError::Unreached { address: self.address.to_string(), cause: root_cause(error) }
    }
}

/// A connection that shows the token, if there is one. All services can share it.
pub type Line = InterceptedService<Channel, Credential>;

/// What is shown with each call.
#[derive(Clone, Debug)]
pub struct Credential(Option<MetadataValue<Ascii>>);

impl Credential {
    /// The token in the first line of this file, or none.
    ///
    /// # Errors
    /// The file, and what is wrong with it.
    pub fn read(file: Option<&Path>) -> Result<Self, ConnectError> {
        let Some(file) = file else { return Ok(Self(None)) };
        let wrong = |cause: String| ConnectError::Token { file: file.to_owned(), cause };
        let text = read_short(file).map_err(|error| wrong(error.to_string()))?;
        let token = text.lines().next().unwrap_or_default().trim();
        if token.is_empty() {
            return Err(wrong("its first line is empty, expected the token".to_owned()));
        }
        let value = format!("Bearer {token}").parse();
        Ok(Self(Some(value.map_err(|_| wrong("expected one line of ASCII".to_owned()))?)))
    }
}

impl Interceptor for Credential {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(value) = &self.0 {
            request.metadata_mut().insert("authorization", value.clone());
        }
        Ok(request)
    }
}

/// Longest file of certificates, of a key or of a token.
const FILE_BYTES_MAX: u64 = 1 << 20;

/// The text of such a file: what has no end would fill the memory.
fn read_short(file: &Path) -> io::Result<String> {
    let mut text = String::new();
    File::open(file)?.take(FILE_BYTES_MAX + 1).read_to_string(&mut text)?;
    if text.len() as u64 > FILE_BYTES_MAX {
        let why = format!("it has more than {FILE_BYTES_MAX} bytes");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, why));
    }
    Ok(text)
}

/// Why there is no connection.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ConnectError {
    /// Nobody answers, or not in a way that could be used.
    #[error("no daemon answers at {address}: {cause}")]
    Unreached {
        /// Where.
        address: String,
        /// The system's own reason.
        cause: String,
    },
    /// A certificate or a key cannot be read.
    #[cfg(feature = "tls")]
    #[error("{}: {cause}", file.display())]
    Certificate {
        /// Its file.
        file: PathBuf,
        /// Why not.
        cause: String,
    },
    /// The token cannot be shown.
    #[error("the token of {}: {cause}", file.display())]
    Token {
        /// Its file.
        file: PathBuf,
        /// Why not.
        cause: String,
    },
}

/// The innermost reason, which is the system's own.
#[must_use]
pub fn root_cause(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_a_host_with_its_port_or_a_socket() {
        let parsed = |text| Address::parse(text).unwrap().to_string();
        assert_eq!(parsed("http://robot:50051"), "http://robot:50051");
        assert_eq!(parsed("robot:50051"), "http://robot:50051");
        assert_eq!(parsed("[::1]:50051"), "http://[::1]:50051");
        assert_eq!(parsed("unix:/run/taxeld/taxeld.sock"), "unix:/run/taxeld/taxeld.sock");
        for text in ["", "robot", "unix:", "http:robot", "ftp://robot:1", "a b:1", "robot:70000", "http://robot"] {
            let error = Address::parse(text).unwrap_err().to_string();
            assert!(error.contains("expected http://HOST:PORT"), "{text}: {error}");
        }
    }

    #[test]
    fn the_first_line_of_the_token_file_is_shown_with_each_call() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        let endless = Credential::read(Some(Path::new("/dev/zero"))).unwrap_err().to_string();
        assert!(endless.contains("it has more than 1048576 bytes"), "{endless}");
        std::fs::write(&file, "s3cret \nanother\n").unwrap();
        let shown = |mut credential: Credential| {
            let request = credential.call(Request::new(())).unwrap();
            request.metadata().get("authorization").map(|value| value.to_str().unwrap().to_owned())
        };
        assert_eq!(shown(Credential::read(Some(&file)).unwrap()).as_deref(), Some("Bearer s3cret"));
        assert_eq!(shown(Credential::read(None).unwrap()), None);
        let missing = folder.path().join("none");
        let said = Credential::read(Some(&missing)).unwrap_err().to_string();
        assert!(said.contains("none"), "{said}");
    }
}
