//! A daemon of a simulated board, as a process.

use std::fs::File;

use taxel_proto::v1::force_service_client::ForceServiceClient;

use crate::common::*;

pub struct Daemon {
    pub child: Ended,
    pub address: SocketAddr,
    pub folder: PathBuf,
    _own: Option<TempDir>,
}

impl Daemon {
    /// One with a folder of its own, changed by `with` before it is started.
    pub fn start(with: impl FnOnce(&mut Command, &Path)) -> Self {
        let own = tempfile::tempdir().unwrap();
        let daemon = Self::start_in(own.path(), with);
        Self { _own: Some(own), ..daemon }
    }

    /// One with configuration, log and socket in this folder, and its store in the folder `disk` there.
    pub fn start_in(folder: &Path, with: impl FnOnce(&mut Command, &Path)) -> Self {
        let address = free_address();
        configure(folder, address, "");
        // The shell sets limits for what it becomes.
        let mut command = Command::new("sh");
        command.args(["-c", "ulimit -n ${DESCRIPTORS:-1024}; exec \"$@\"", "sh", env!("CARGO_BIN_EXE_taxeld"), "run"]);
        command.arg("--config").arg(folder.join("taxeld.toml"));
        command.current_dir(folder).stderr(File::create(folder.join("log")).unwrap());
        with(&mut command, folder);
        let child = Ended(command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap());
        Self { child, address, folder: folder.to_path_buf(), _own: None }
    }

    pub fn log(&self) -> String {
        std::fs::read_to_string(self.folder.join("log")).unwrap()
    }

    /// A stream of forces, as soon as the daemon serves.
    pub async fn stream(&self) -> Streaming<v1::ForceSample> {
        let begun = Instant::now();
        loop {
            match ForceServiceClient::connect(format!("http://{}", self.address)).await {
                Ok(mut client) => match client.stream_force(v1::StreamRequest::default()).await {
                    Ok(stream) => return stream.into_inner(),
                    Err(error) => assert!(begun.elapsed() < PATIENCE, "the daemon takes no call: {error}"),
                },
                Err(error) => assert!(begun.elapsed() < PATIENCE, "the daemon does not come up: {error}"),
            }
            tokio::task::yield_now().await;
        }
    }
}

/// Writes the configuration; `more` are keys that come first.
pub fn configure(folder: &Path, address: SocketAddr, more: &str) {
    let text = format!(
        "listen = [\"tcp:{address}\", \"unix:socket\"]\n{more}\n[store]\npath = \"disk/store.db\"\n\
         [[bus]]\nname = \"skin\"\nsource = \"sim\"\n\
         [[patch]]\nname = \"forearm\"\nbus = \"skin\"\nboards = [{{ address = 13, modules = \"0-15\" }}]\n"
    );
    std::fs::write(folder.join("taxeld.toml"), text).unwrap();
}
