//! The line of a command in the daemon's log.

use std::io::Write;
use std::sync::{Arc, Mutex};

use taxel_engine::command::Done;
use taxel_proto::v1;
use taxel_proto::v1::skin_service_client::SkinServiceClient;
use tokio::sync::Notify;
use tracing_subscriber::fmt::MakeWriter;

use crate::fixture::start;

/// What this thread logs. The server of a test runs on the thread of the test.
#[derive(Clone, Default)]
struct Log {
    text: Arc<Mutex<String>>,
    written: Arc<Notify>,
}

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.text.lock().unwrap().push_str(&String::from_utf8_lossy(bytes));
        self.written.notify_one();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Log {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        self.clone()
    }
}

impl Log {
    fn begin() -> (Self, tracing::subscriber::DefaultGuard) {
        let log = Self::default();
        let subscriber = tracing_subscriber::fmt().with_ansi(false).with_writer(log.clone()).finish();
        (log, tracing::subscriber::set_default(subscriber))
    }

    /// The first line that has this, once it is there.
    async fn line_with(&self, what: &str) -> String {
        loop {
            let found = self.text.lock().unwrap().lines().find(|line| line.contains(what)).map(str::to_owned);
            match found {
                Some(line) => return line,
                None => self.written.notified().await,
            }
        }
    }
}

#[tokio::test]
async fn a_command_that_is_answered_has_one_line() {
    let (log, _guard) = Log::begin();
    let mut daemon = start().await;
    let mut client = SkinServiceClient::new(daemon.connect().await);
    let bring_up = client.bring_up(v1::TareRequest::default());
    let (answer, ()) = tokio::join!(bring_up, daemon.answer(Ok(Done::BringUpStarted), |_| ()));
    answer.unwrap();
    let line = log.line_with("command=\"BringUp\"").await;
    assert!(line.contains("done"), "{line}");
    assert_eq!(log.text.lock().unwrap().matches("command=").count(), 1);
}

#[tokio::test]
async fn a_call_that_is_refused_is_in_the_log_with_whose_it_was() {
    let (log, _guard) = Log::begin();
    let daemon = start().await;
    let mut request = tonic::Request::new(v1::TareRequest::default());
    request.metadata_mut().insert("authorization", "Bearer wrong".parse().unwrap());
    SkinServiceClient::new(daemon.connect().await).tare(request).await.unwrap_err();
    log.line_with("a call was refused: taxel.v1.SkinService/Tare from 127.0.0.1").await;
}
