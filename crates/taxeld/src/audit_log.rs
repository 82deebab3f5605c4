//! The audit log as lines of text, and `taxeld audit --store` of a daemon that does not run.

use std::path::Path;

use crate::store_at::read_store;
use taxel_engine::audit::AuditEntry;
use taxel_proto::Timestamp;

/// Prints these lines, of which the newest is the first, oldest first.
pub fn print(mut lines: Vec<String>) {
    lines.reverse();
    if lines.is_empty() {
        say!("the audit log is empty");
    }
    lines.iter().for_each(|line| say!("{line}"));
}

/// Entries of a store that are read at a time.
const PAGE: u32 = 500;

/// Whether an entry is about `patch`, if one is named. What it was about may be what is damaged.
pub fn is_about(patch: Option<&str>, of_entry: &str, damage: &str) -> bool {
    patch.is_none_or(|patch| patch == of_entry || !damage.is_empty())
}

/// The newest `last` entries of a store, or of those about `patch`, newest first.
///
/// # Errors
/// If there is no such store, or it cannot be read.
pub fn of_store(path: &Path, last: u32, patch: Option<&str>) -> anyhow::Result<Vec<String>> {
    let store = read_store(path)?;
    let (mut lines, mut before) = (Vec::new(), Some(u64::MAX));
    while let Some(number) = before.filter(|_| lines.len() < last as usize) {
        let entries = store.audit(number, PAGE)?;
        before = entries.last().map(|entry| entry.number);
        let of = |entry: &AuditEntry| entry.asked.as_ref().map_or_else(String::new, |asked| asked.patch.clone());
        let asked = entries.iter().filter(|entry| is_about(patch, &of(entry), &entry.damage));
        lines.extend(asked.take(last as usize - lines.len()).map(line_of_entry));
    }
    Ok(lines)
}

/// One entry's parts, whose order both sources share.
pub struct Line<'a> {
    pub number: u64,
    pub seconds: Option<i64>,
    pub who: [&'a str; 4],
    pub what: [&'a str; 4],
    pub sets: [&'a str; 2],
    pub result: &'a str,
    pub damage: &'a str,
}

impl Line<'_> {
    pub fn text(&self) -> String {
        let [who, role, transport, from] = self.who;
        let [method, request, claimed, patch] = self.what;
        let time = self
            .seconds
            .map_or_else(|| "unknown time".to_owned(), |seconds| Timestamp { seconds, nanos: 0 }.to_string());
        let mut text = format!("{} {time} {who} ({role}, {transport} {from}): {method}", self.number);
        for (word, value) in [("", request), ("patch ", patch), ("says to be ", claimed)] {
            if !value.is_empty() {
                text += &format!(", {word}{value}");
            }
        }
        let [before, after] = self.sets.map(|set| if set.is_empty() { "none" } else { set });
        let lost = "no result was written down: the daemon stopped, or the disk took no more";
        let result = if self.result.is_empty() { lost } else { self.result };
        text += &format!("; model set {before} -> {after}; {result}");
        if !self.damage.is_empty() {
            text += &format!("; DAMAGED ON DISK: {}", self.damage);
        }
        taxel_skin::printable(&text) // an entry is one line, whatever was written into it
    }
}

fn line_of_entry(entry: &AuditEntry) -> String {
    let (asked, answered) = (entry.asked.clone().unwrap_or_default(), entry.answered.clone().unwrap_or_default());
    Line {
        number: entry.number,
        seconds: entry.asked.as_ref().map(|asked| asked.wall_ns.div_euclid(1_000_000_000)),
        who: [&asked.who, &asked.role, &asked.transport, &asked.place],
        what: [&asked.method, &asked.what, &asked.claimed, &asked.patch],
        sets: [&asked.before, &answered.after],
        result: &answered.result,
        damage: &entry.damage,
    }
    .text()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a client sent is part of a refusal, and older rows have it as it came.
    #[test]
    fn an_entry_is_one_line_whatever_was_written_into_it() {
        let result =
            "refused: no model set `m-x`; done\n2 2026-11-25T09:00:00Z ann (admin): DeleteSession; done\n\u{1b}[8m";
        let line = Line {
            number: 7,
            seconds: Some(0),
            who: ["eve", "operator", "unix", "uid 7"],
            what: ["ActivateModelSet", "", "", ""],
            sets: ["", ""],
            result,
            damage: "",
        };
        let text = line.text();
        assert_eq!(taxel_skin::unprintable(&text), None, "{text}");
        assert!(
            text.starts_with("7 1970-01-01T00:00:00Z eve (operator") && text.ends_with("done\\n\\u{1b}[8m"),
            "{text}"
        );
    }
}
