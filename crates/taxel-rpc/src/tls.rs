//! TLS 1.3 with client certificates, from files that can be read again while connections are served.

use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};

use tokio::net::TcpStream;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::server::WebPkiClientVerifier;
use tokio_rustls::rustls::version::TLS13;
use tokio_rustls::rustls::{RootCertStore, ServerConfig};
use tokio_rustls::server::TlsStream;
use x509_cert::der::Decode;
use x509_cert::der::oid::db::rfc4519::COMMON_NAME;
use x509_cert::ext::pkix::SubjectAltName;
use x509_cert::ext::pkix::name::GeneralName;

use crate::access::origin::{Certificate, uri_name};
use crate::access::private_file::{SECRET, TRUSTED, read_guarded};

/// What a TLS listener is made from, all in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The server's certificate, and those between it and its authority; only its owner may change it.
    pub certificate: PathBuf,
    /// Its key, which only its owner may read.
    pub key: PathBuf,
    /// The authorities that sign clients' certificates. Who can change it can make himself anybody: only its owner, who is
    /// root or the daemon's own account, may.
    pub client_ca: PathBuf,
}

/// The certificates of a listener as they are now. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Tls {
    files: Arc<TlsFiles>,
    config: Arc<RwLock<Arc<ServerConfig>>>,
}

impl Tls {
    /// Reads the files.
    ///
    /// # Errors
    /// The file, and what is wrong with it.
    pub fn load(files: TlsFiles) -> Result<Self, String> {
        let config = Arc::new(RwLock::new(server_config(&files)?));
        Ok(Self { files: Arc::new(files), config })
    }

    /// Reads the files again. New connections get what is in them now; those that are open go on as they are.
    ///
    /// # Errors
    /// The file, and what is wrong with it; then everything stays as it was.
    pub fn reload(&self) -> Result<(), String> {
        let config = server_config(&self.files)?;
        *self.config.write().unwrap_or_else(PoisonError::into_inner) = config;
        Ok(())
    }

    /// Takes a client's hello, and gives the connection with what its certificate says.
    pub(crate) async fn handshake(&self, io: TcpStream) -> Result<(TlsStream<TcpStream>, Certificate), String> {
        let config = Arc::clone(&self.config.read().unwrap_or_else(PoisonError::into_inner));
        let stream = TlsAcceptor::from(config).accept(io).await.map_err(|error| error.to_string())?;
        let chain = stream.get_ref().1.peer_certificates().unwrap_or_default();
        let certificate = read_certificate(chain.first().ok_or("the client showed no certificate")?)?;
        Ok((stream, certificate))
    }
}

fn server_config(files: &TlsFiles) -> Result<Arc<ServerConfig>, String> {
    let wrong = |path: &Path, problem: String| format!("{}: {problem}", path.display());
    let provider = Arc::new(ring::default_provider());
    let mut roots = RootCertStore::empty();
    for authority in certificates(&files.client_ca)? {
        roots.add(authority).map_err(|error| wrong(&files.client_ca, error.to_string()))?;
    }
    let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), Arc::clone(&provider))
        .build()
        .map_err(|error| wrong(&files.client_ca, error.to_string()))?;
    let secret = read_guarded(&files.key, SECRET)?;
    let key = PrivateKeyDer::from_pem_slice(&secret).map_err(|error| wrong(&files.key, error.to_string()))?;
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&TLS13])
        .map_err(|error| wrong(&files.certificate, error.to_string()))?
        .with_client_cert_verifier(verifier)
        .with_single_cert(certificates(&files.certificate)?, key)
        .map_err(|error| wrong(&files.certificate, format!("does not go with the key: {error}")))?;
    config.alpn_protocols = vec![b"h2".to_vec()];
    // A resumed connection would not show its certificate again.
    config.send_tls13_tickets = 0;
    Ok(Arc::new(config))
}

/// All certificates of a file, at least one.
fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, String> {
    let wrong = |problem: String| format!("{}: {problem}", path.display());
    let text = read_guarded(path, TRUSTED)?;
    let read = CertificateDer::pem_slice_iter(&text).collect::<Result<Vec<_>, _>>();
    let found = read.map_err(|error| wrong(error.to_string()))?;
    if found.is_empty() { Err(wrong("there is no certificate in it".to_owned())) } else { Ok(found) }
}

/// The names and the end of a certificate that was verified.
fn read_certificate(der: &[u8]) -> Result<Certificate, String> {
    let unreadable = |error: x509_cert::der::Error| format!("the client certificate cannot be read: {error}");
    let certificate = x509_cert::Certificate::from_der(der).map_err(unreadable)?;
    let content = certificate.tbs_certificate();
    let alternative = content.get_extension::<SubjectAltName>().map_err(unreadable)?;
    let alternative = alternative.map(|(_, names)| names.0).unwrap_or_default();
    let named = |name: &GeneralName| match name {
        GeneralName::UniformResourceIdentifier(uri) => Some(uri_name(uri.as_str())),
        GeneralName::DnsName(dns) => Some(format!("DNS:{}", dns.as_str())),
        _ => None,
    };
    let mut names: Vec<String> = alternative.iter().filter_map(named).collect();
    let subject = content.subject();
    // Programs differ in which of several they take for the name of the subject, so that none of them is.
    let is_named = subject.iter().filter(|attribute| attribute.oid == COMMON_NAME).count() == 1;
    if let Some(common) = subject.common_name().map_err(unreadable)?.filter(|_| is_named) {
        names.push(format!("CN={}", common.value()));
    }
    Ok(Certificate { names, until: content.validity().not_after.to_system_time() })
}
