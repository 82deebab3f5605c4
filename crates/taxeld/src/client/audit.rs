//! `taxeld audit`: who changed what.

use std::path::PathBuf;

use taxel_proto::v1;

use super::connect::Server;
use super::failure::Outcome;
use crate::audit_log::{Line, is_about, of_store, print};

/// Entries of one question.
const PAGE: u32 = 500;

/// Who changed what, the newest last: the audit log of a running daemon, which asks for the role operator, or of a store.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld audit                                        # the last 50\n  taxeld audit --token bench.token --last 500\n  taxeld audit --store /var/lib/taxeld/taxeld.db      # of a daemon that does not run"
)]
pub struct AuditArgs {
    #[command(flatten)]
    server: Server,
    /// Read this store, and ask no daemon; its own must not run.
    #[arg(long, value_name = "STORE.db")]
    store: Option<PathBuf>,
    /// At most so many entries, the newest.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    last: u32,
}

/// Runs it.
///
/// # Errors
/// No daemon, one that refuses, or a store that cannot be read.
pub async fn audit(args: AuditArgs) -> Outcome {
    let lines = match &args.store {
        Some(path) => of_store(path, args.last, args.server.patch())?,
        None => of_daemon(&args).await?,
    };
    print(lines);
    Ok(())
}

/// The newest entries, newest first.
async fn of_daemon(args: &AuditArgs) -> Outcome<Vec<String>> {
    let daemon = args.server.connect().await?;
    let (mut lines, mut page_token) = (Vec::new(), String::new());
    while lines.len() < args.last as usize {
        let left = args.last as usize - lines.len();
        // Of one patch nobody knows how far back they lie.
        let page_size = args.server.patch().map_or(PAGE.min(left as u32), |_| PAGE);
        let request = v1::ListAuditRequest { page_size, page_token };
        let answer = daemon.audit().list_audit(request).await?.into_inner();
        let about = |entry: &&v1::AuditEntry| is_about(args.server.patch(), &entry.patch, &entry.damage);
        lines.extend(answer.entries.iter().filter(about).take(left).map(line_of_message));
        page_token = answer.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    Ok(lines)
}

fn line_of_message(entry: &v1::AuditEntry) -> String {
    Line {
        number: entry.entry,
        seconds: entry.time.as_ref().map(|time| time.seconds),
        who: [&entry.who, &entry.role, &entry.transport, &entry.from],
        what: [&entry.method, &entry.request, &entry.claimed_name, &entry.patch],
        sets: [&entry.model_set_before, &entry.model_set_after],
        result: &entry.result,
        damage: &entry.damage,
    }
    .text()
}
