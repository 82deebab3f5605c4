//! The service `tare`: an operator's button in ROS.

use std::time::Duration;

use taxel_proto::v1::TareRequest;
use tonic::Status;

use crate::daemon::{Daemon, words};
use crate::ros::node::Trigger;
use crate::ros::types::TriggerResponse;

/// A daemon that has not answered within this time answers no more: it watches the skin for a second or two, and writes the
/// zero down.
const ANSWER_WITHIN: Duration = Duration::from_secs(30);

/// Answers requests for ever, one after the other: takes the zero of each patch, without vouching for anything, so that
/// the daemon itself must see rest.
///
/// # Errors
/// If the session is closed.
pub async fn serve(trigger: Trigger, daemon: Daemon, patches: Vec<String>) -> anyhow::Result<()> {
    loop {
        let request = trigger.next().await?;
        let mut response = TriggerResponse { success: true, message: String::new() };
        let mut said = Vec::new();
        for patch in &patches {
            let ask = TareRequest { patch: patch.clone(), confirmed_by: String::new() };
            let late = |_| Err(Status::deadline_exceeded(format!("no answer within {} s", ANSWER_WITHIN.as_secs())));
            match tokio::time::timeout(ANSWER_WITHIN, daemon.skin().tare(ask)).await.unwrap_or_else(late) {
                Ok(status) => said.push(format!("{patch}: {}", status.into_inner().reason)),
                Err(status) => {
                    response.success = false;
                    said.push(format!("{patch}: refused: {}", words(&status)));
                }
            }
        }
        response.message = said.join("; ");
        tracing::info!(success = response.success, "tare: {}", response.message);
        if let Err(error) = request.answer(&response).await {
            tracing::warn!("tare: the answer did not go out: {error:#}");
        }
    }
}
