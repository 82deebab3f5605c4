//! `AuditService`: the audit log.

use taxel_engine::audit::AuditEntry;
use taxel_proto::v1;
use taxel_proto::v1::audit_service_server::AuditService;
use tonic::{Request, Response};

use crate::backend::ask;
use crate::convert::timestamp;
use crate::page::part;
use crate::service::{Reply, Service, held};

#[tonic::async_trait]
impl AuditService for Service {
    async fn list_audit(&self, request: Request<v1::ListRequest>) -> Reply<v1::ListAuditResponse> {
        let (mut held, request) = (held(&request)?, request.into_inner());
        let (most, mut before) = part(&request)?;
        // Of one patch it has what is known to be of it, and what is damaged.
        let patch = request.patch;
        let is_of = |entry: &v1::AuditEntry| patch.is_empty() || entry.patch == patch || !entry.damage.is_empty();
        let mut entries = Vec::new();
        loop {
            let (read, still) = ask(held, |told| self.backend.audit(before, most as u32, told)).await?;
            held = still;
            let is_end = read.len() < most;
            before = read.last().map_or(0, |last| last.number);
            entries.extend(read.into_iter().map(message).filter(is_of));
            if is_end || entries.len() >= most {
                entries.truncate(most);
                return Ok(Response::new(v1::ListAuditResponse { entries }));
            }
        }
    }
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
