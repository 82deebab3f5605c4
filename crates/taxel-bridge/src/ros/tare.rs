//! The service `tare`: an operator's button in ROS.

use taxel_proto::v1::TareRequest;

use crate::daemon::{Daemon, words};
use crate::ros::node::Trigger;
use crate::ros::types::TriggerResponse;
use crate::ros::zenoh;

/// Answers requests for ever, one after the other.
///
/// # Errors
/// If the middleware has ended.
pub async fn serve(trigger: Trigger, daemon: Daemon, patches: Vec<String>) -> anyhow::Result<()> {
    loop {
        let sent = match &trigger {
            Trigger::Dds(server) => {
                let (id, ()) = server.async_receive_request().await?;
                server.async_send_response(id, tare(&daemon, &patches).await).await.map_err(Into::into)
            }
            Trigger::Zenoh(service) => {
                let request = service.next().await?;
                zenoh::answer(request, &tare(&daemon, &patches).await).await
            }
        };
        if let Err(error) = sent {
            tracing::warn!("tare: the answer did not go out: {error:#}");
        }
    }
}

/// Takes the zero of each patch. It confirms nothing, so the daemon itself must see an unloaded skin.
async fn tare(daemon: &Daemon, patches: &[String]) -> TriggerResponse {
    let (mut success, mut said) = (true, Vec::new());
    for patch in patches {
        let ask = TareRequest { patch: patch.clone(), confirmed_by: String::new() };
        match daemon.skin().tare(ask).await {
            Ok(status) => said.push(format!("{patch}: {}", status.get_ref().reason)),
            Err(why) => {
                success = false;
                said.push(format!("{patch}: refused: {}", words(&why)));
            }
        }
    }
    let message = said.join("; ");
    tracing::info!(success, "tare: {message}");
    TriggerResponse { success, message }
}
