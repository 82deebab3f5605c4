//! Authorities and certificates for the tests, made anew each time.

use rcgen::{
    BasicConstraints, CertificateParams, CertifiedIssuer, DnType, ExtendedKeyUsagePurpose, IsCa, KeyPair, SanType,
    date_time_ymd,
};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use taxel_rpc::TlsFiles;
use tonic::transport::Identity;

/// An authority.
pub struct Authority(CertifiedIssuer<'static, KeyPair>);

/// A certificate with its key, in PEM.
pub struct Leaf {
    pub certificate: String,
    pub key: String,
}

impl Leaf {
    pub fn identity(&self) -> Identity {
        Identity::from_pem(&self.certificate, &self.key)
    }
}

impl Authority {
    pub fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        Self(CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap())
    }

    pub fn pem(&self) -> String {
        self.0.pem()
    }

    pub fn server(&self) -> Leaf {
        let mut params = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        self.sign(&params)
    }

    pub fn client(&self, uri: &str) -> Leaf {
        self.sign(&client(uri))
    }

    /// With one or two common names and another name.
    pub fn named_client(&self, common: &[&str], alternative: SanType) -> Leaf {
        let mut params = client("");
        params.subject_alt_names = vec![alternative];
        let again = DnType::CustomDnType(vec![2, 5, 4, 3]); // the common name's own number: there may be one of each word
        for (kind, name) in [DnType::CommonName, again].into_iter().zip(common) {
            params.distinguished_name.push(kind, *name);
        }
        self.sign(&params)
    }

    pub fn expired_client(&self, uri: &str) -> Leaf {
        let mut params = client(uri);
        (params.not_before, params.not_after) = (date_time_ymd(2001, 1, 1), date_time_ymd(2002, 1, 1));
        self.sign(&params)
    }

    fn sign(&self, params: &CertificateParams) -> Leaf {
        let key = KeyPair::generate().unwrap();
        Leaf { certificate: params.signed_by(&key, &self.0).unwrap().pem(), key: key.serialize_pem() }
    }
}

fn client(uri: &str) -> CertificateParams {
    let mut params = CertificateParams::new(Vec::new()).unwrap();
    params.distinguished_name.push(DnType::CommonName, "somebody");
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
    params.subject_alt_names.push(SanType::URI(uri.try_into().unwrap()));
    params
}

/// Writes what a listener needs.
pub fn files(folder: &Path, server: &Leaf, clients: &Authority) -> TlsFiles {
    let write = |name: &str, text: &str| -> PathBuf {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        path
    };
    TlsFiles {
        certificate: write("server.pem", &server.certificate),
        key: write("server.key", &server.key),
        client_ca: write("clients.pem", &clients.pem()),
    }
}
