//! `AuditService`: the audit log in pages.

use taxel_engine::audit::AuditEntry;
use taxel_proto::v1;
use taxel_proto::v1::audit_service_server::AuditService;
use tonic::Request;

use crate::backend::ask;
use crate::convert::timestamp;
use crate::page::{before, page_size};
use crate::service::{Reply, Service, held, list};

#[tonic::async_trait]
impl AuditService for Service {
    async fn list_audit(&self, request: Request<v1::ListRequest>) -> Reply<v1::ListAuditResponse> {
        let held = held(&request)?;
        let v1::ListRequest { patch, page_size: size, page_token } = request.into_inner();
        let size = page_size(size)?;
        let before = before(&page_token)?;
        // One more than is shown tells whether there is another page.
        let (entries, _) = ask(held, |told| self.backend.audit(before, size as u32 + 1, told)).await?;
        list(move || Ok(page(entries, size, &patch))).await
    }
}

/// A page of so many, of which there may be more. Of one patch it has what is known to be of it, and what is damaged.
fn page(mut entries: Vec<AuditEntry>, size: usize, patch: &str) -> v1::ListAuditResponse {
    let more = entries.len() > size;
    entries.truncate(size);
    let next_page_token = entries.last().filter(|_| more).map(|last| last.number.to_string()).unwrap_or_default();
    let is_of = |entry: &v1::AuditEntry| patch.is_empty() || entry.patch == patch || !entry.damage.is_empty();
    v1::ListAuditResponse { entries: entries.into_iter().map(message).filter(is_of).collect(), next_page_token }
}

fn message(entry: AuditEntry) -> v1::AuditEntry {
    let time = entry.asked.as_ref().and_then(|asked| timestamp(asked.wall_ns));
    let answered = entry.answered.as_ref().and_then(|answered| timestamp(answered.wall_ns));
    let (asked, result) = (entry.asked.unwrap_or_default(), entry.answered.unwrap_or_default());
    v1::AuditEntry {
        entry: entry.number,
        time,
        who: asked.who,
        role: asked.role,
        transport: asked.transport,
        from: asked.place,
        method: asked.method,
        request: asked.what,
        claimed_name: asked.claimed,
        patch: asked.patch,
        model_set_before: asked.before,
        answered,
        result: result.result,
        model_set_after: result.after,
        damage: entry.damage,
    }
}
