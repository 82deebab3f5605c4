//! The service `tare`: an operator's button in ROS.

use taxel_proto::v1::TareRequest;

use crate::daemon::{Daemon, answered};
use crate::ros::node::Trigger;
use crate::ros::types::TriggerResponse;

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
            match answered(daemon.skin().tare(ask)).await {
                Ok(status) => said.push(format!("{patch}: {}", status.reason)),
                Err(why) => {
                    response.success = false;
                    said.push(format!("{patch}: refused: {why}"));
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
