//! `taxeld audit`: the audit log, of a running daemon or of the store of one that does not run.

use std::path::{Path, PathBuf};
use std::sync::mpsc;

use anyhow::{Context, anyhow};
use taxel_engine::audit::AuditEntry;
use taxel_proto::v1;
use taxel_proto::v1::audit_service_client::AuditServiceClient;
use taxel_store::Store;
use tonic::transport::Endpoint;

/// Entries of one question.
const PAGE: u32 = 500;

/// What of the audit log is shown.
#[derive(Debug, clap::Args)]
pub struct AuditArgs {
    /// Where the daemon serves: an address of this machine, or unix:PATH.
    #[arg(long, default_value = "127.0.0.1:50051")]
    at: String,
    /// A file with a token; the audit log needs the role operator.
    #[arg(long, value_name = "FILE")]
    token: Option<PathBuf>,
    /// Read this store instead; its daemon must not run.
    #[arg(long, value_name = "STORE.db", conflicts_with_all = ["at", "token"])]
    store: Option<PathBuf>,
    /// At most so many entries, the newest.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    last: u32,
}

/// Prints the newest entries, oldest of them first.
///
/// # Errors
/// If the daemon or the store cannot be asked, or refuses.
pub fn audit(args: &AuditArgs) -> anyhow::Result<()> {
    let mut lines = match &args.store {
        Some(path) => of_store(path, args.last)?,
        None => crate::runtime::runtime()?.block_on(of_daemon(args))?,
    };
    lines.reverse();
    if lines.is_empty() {
        say!("the audit log is empty");
    }
    lines.iter().for_each(|line| say!("{line}"));
    Ok(())
}

fn of_store(path: &Path, last: u32) -> anyhow::Result<Vec<String>> {
    if !path.exists() {
        anyhow::bail!("{}: there is no such store", path.display());
    }
    let (store, ..) = Store::open(path, Box::new(|_| ()))?;
    let (tell, told) = mpsc::channel();
    let tell = move |entries| {
        let _ = tell.send(entries); // it is received just below
    };
    store.audit_reader().read(u64::MAX, last, Box::new(tell));
    let entries = told.recv().context("the store's thread")??;
    store.close()?;
    Ok(entries.iter().map(line_of_entry).collect())
}

async fn of_daemon(args: &AuditArgs) -> anyhow::Result<Vec<String>> {
    let at = if args.at.starts_with("unix:") { args.at.clone() } else { format!("http://{}", args.at) };
    let endpoint = Endpoint::from_shared(at).with_context(|| format!("--at {}", args.at))?;
    let channel = endpoint.connect().await.with_context(|| format!("no daemon at {}", args.at))?;
    let token = args.token.as_deref().map(bearer).transpose()?;
    let mut client = AuditServiceClient::new(channel);
    let (mut lines, mut page_token) = (Vec::new(), String::new());
    while lines.len() < args.last as usize {
        let page_size = PAGE.min(args.last - lines.len() as u32);
        let mut request = tonic::Request::new(v1::ListAuditRequest { page_size, page_token });
        if let Some(token) = &token {
            request.metadata_mut().insert("authorization", token.clone());
        }
        let answer = client.list_audit(request).await.map_err(|status| anyhow!("{}", status.message()))?.into_inner();
        lines.extend(answer.entries.iter().map(line_of_message));
        page_token = answer.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    Ok(lines)
}

fn bearer(path: &Path) -> anyhow::Result<tonic::metadata::AsciiMetadataValue> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{}", path.display()))?;
    format!("Bearer {}", text.trim()).parse().with_context(|| format!("{}: is no token", path.display()))
}

/// One entry's parts, whose order both sources share.
struct Line<'a> {
    number: u64,
    seconds: Option<i64>,
    who: [&'a str; 4],
    what: [&'a str; 4],
    sets: [&'a str; 2],
    result: &'a str,
    damage: &'a str,
}

impl Line<'_> {
    fn text(&self) -> String {
        let [who, role, transport, from] = self.who;
        let [method, request, claimed, patch] = self.what;
        let time = self.seconds.map_or_else(|| "unknown time".to_owned(), utc);
        let mut text = format!("{} {time} {who} ({role}, {transport} {from}): {method}", self.number);
        for (word, value) in [("", request), ("patch ", patch), ("says to be ", claimed)] {
            if !value.is_empty() {
                text += &format!(", {word}{value}");
            }
        }
        let [before, after] = self.sets.map(|set| if set.is_empty() { "none" } else { set });
        let result = if self.result.is_empty() { "the daemon stopped before it answered" } else { self.result };
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

/// Seconds since 1970 as a date and time of day.
fn utc(seconds: i64) -> String {
    let (days, rest) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    // Days to a date in the proleptic Gregorian calendar, counted from 1 March of year 0 in cycles of 400 years.
    let shifted = days + 719_468;
    let (cycle, day) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_cycle = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day_of_year = day - (365 * year_of_cycle + year_of_cycle / 4 - year_of_cycle / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day_of_month = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_cycle + 400 * cycle + i64::from(month <= 2);
    let (hours, minutes, seconds) = (rest / 3600, rest / 60 % 60, rest % 60);
    format!("{year:04}-{month:02}-{day_of_month:02}T{hours:02}:{minutes:02}:{seconds:02}Z")
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

    #[test]
    fn seconds_are_dates() {
        let cases = [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_700_000_000, "2023-11-14T22:13:20Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
            (-1, "1969-12-31T23:59:59Z"),
        ];
        for (seconds, expected) in cases {
            assert_eq!(utc(seconds), expected);
        }
    }
}
