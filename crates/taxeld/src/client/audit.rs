//! `taxeld audit`: who changed what.

use taxel_proto::v1;

use super::connect::Asked;
use super::failure::Outcome;
use super::{json, table};

/// Who changed what, the newest last. It asks for the role operator.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  taxeld audit                                        # the last 50\n  taxeld audit --token bench.token --last 500"
)]
pub struct AuditArgs {
    #[command(flatten)]
    asked: Asked,
    /// Entries to show, the newest.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=1000))]
    last: u32,
}

/// Runs it.
///
/// # Errors
/// No daemon, or one that refuses.
pub async fn audit(args: AuditArgs) -> Outcome {
    let daemon = args.asked.daemon().await?;
    let request = v1::ListRequest { patch: daemon.patch.clone(), most: args.last, before: 0 };
    let entries = daemon.audit().list_audit(request).await?.into_inner().entries;
    if args.asked.json {
        return entries.iter().rev().try_for_each(|entry| json::print("AuditEntry", entry));
    }
    if entries.is_empty() {
        say!("the audit log is empty");
    }
    entries.iter().rev().for_each(|entry| say!("{}", line(entry)));
    Ok(())
}

fn line(entry: &v1::AuditEntry) -> String {
    let time = entry.time.as_ref().map_or_else(|| "unknown time".to_owned(), |time| table::moment(Some(time)));
    let v1::AuditEntry { entry: number, who, role, transport, from, method, .. } = entry;
    let mut text = format!("{number} {time} {who} ({role}, {transport} {from}): {method}");
    for (word, value) in [("", &entry.request), ("patch ", &entry.patch), ("says to be ", &entry.claimed_name)] {
        if !value.is_empty() {
            text += &format!(", {word}{value}");
        }
    }
    let or = |text: &str, other: &str| if text.is_empty() { other.to_owned() } else { text.to_owned() };
    let (before, after) = (or(&entry.model_set_before, "none"), or(&entry.model_set_after, "none"));
    let result = or(&entry.result, "no result was written down: the daemon stopped, or the disk took no more");
    text += &format!("; model set {before} -> {after}; {result}");
    if !entry.damage.is_empty() {
        text += &format!("; DAMAGED ON DISK: {}", entry.damage);
    }
    taxel_skin::printable(&text) // an entry is one line, whatever was written into it
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a client sent is part of a refusal.
    #[test]
    fn an_entry_is_one_line_whatever_was_written_into_it() {
        let result =
            "refused: no model set `m-x`; done\n2 2026-11-25T09:00:00Z ann (admin): done\n\u{1b}[8m".to_owned();
        let time = Some(taxel_proto::Timestamp { seconds: 0, nanos: 0 });
        let text = line(&v1::AuditEntry { entry: 7, time, who: "eve".to_owned(), result, ..Default::default() });
        assert_eq!(taxel_skin::unprintable(&text), None, "{text}");
        let begins = format!("7 {} eve (", table::moment(time.as_ref()));
        assert!(text.starts_with(&begins) && text.ends_with("done\\n\\u{1b}[8m"), "{text}");
    }
}
