//! `taxeld audit`: who changed what.

use taxel_proto::v1;

use super::connect::Server;
use super::failure::Outcome;

/// Entries of one question.
const PAGE: u32 = 500;

/// Who changed what, the newest last: the audit log of a running daemon, which asks for the role operator.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  taxeld audit # the last 50\n  taxeld audit --token bench.token --last 500")]
pub struct AuditArgs {
    #[command(flatten)]
    server: Server,
    /// At most so many entries, the newest.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    last: u32,
}

/// Runs it.
///
/// # Errors
/// No daemon, or one that refuses.
pub async fn audit(args: AuditArgs) -> Outcome {
    let daemon = args.server.connect().await?;
    let (mut lines, mut page_token) = (Vec::new(), String::new());
    while lines.len() < args.last as usize {
        let left = args.last as usize - lines.len();
        // Of one patch nobody knows how far back they lie.
        let page_size = args.server.patch().map_or(PAGE.min(left as u32), |_| PAGE);
        let request = v1::ListAuditRequest { page_size, page_token };
        let answer = daemon.audit().list_audit(request).await?.into_inner();
        // What an entry is about may be what is damaged.
        let about = |entry: &&v1::AuditEntry| {
            args.server.patch().is_none_or(|patch| patch == entry.patch || !entry.damage.is_empty())
        };
        lines.extend(answer.entries.iter().filter(about).take(left).map(line));
        page_token = answer.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    if lines.is_empty() {
        say!("the audit log is empty");
    }
    lines.iter().rev().for_each(|line| say!("{line}"));
    Ok(())
}

/// An entry is one line, whatever was written into it.
fn line(entry: &v1::AuditEntry) -> String {
    let v1::AuditEntry { entry: number, who, role, transport, from, method, .. } = entry;
    let time = entry.time.as_ref().map_or_else(|| "unknown time".to_owned(), ToString::to_string);
    let mut text = format!("{number} {time} {who} ({role}, {transport} {from}): {method}");
    for (word, value) in [("", &entry.request), ("patch ", &entry.patch), ("says to be ", &entry.claimed_name)] {
        if !value.is_empty() {
            text += &format!(", {word}{value}");
        }
    }
    let [before, after] =
        [&entry.model_set_before, &entry.model_set_after].map(|set| if set.is_empty() { "none" } else { set });
    let lost = "no result was written down: the daemon stopped, or the disk took no more";
    let result = if entry.result.is_empty() { lost } else { &entry.result };
    text += &format!("; model set {before} -> {after}; {result}");
    if !entry.damage.is_empty() {
        text += &format!("; DAMAGED ON DISK: {}", entry.damage);
    }
    taxel_skin::printable(&text)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a client sent is part of a refusal, and older rows have it as it came.
    #[test]
    fn an_entry_is_one_line_whatever_was_written_into_it() {
        let result =
            "refused: no model set `m-x`; done\n2 2026-11-25T09:00:00Z ann (admin): DeleteSession; done\n\u{1b}[8m";
        let text = line(&v1::AuditEntry { result: result.to_owned(), ..v1::AuditEntry::default() });
        assert_eq!(taxel_skin::unprintable(&text), None, "{text}");
        assert!(text.ends_with("done\\n\\u{1b}[8m"), "{text}");
    }
}
