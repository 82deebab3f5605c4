//! What is on a robot's ports of YARP: which are skin, and which of their triangles are alive.

use std::time::Duration;

use anyhow::ensure;
use taxel_skin::{Module, ModuleKind, VALUES_PER_BOARD, VALUES_PER_MODULE as VALUES, written_modules};
use taxel_yarp::{NameServer, PortError, PortReader, read_counts};
use tokio::time::{Instant, timeout};

/// Reads all ports with skin in their name for so long; a text for people.
///
/// # Errors
/// A name server that is not known or does not answer, or knows no such port.
pub async fn text(server: Option<&str>, over: Duration) -> anyhow::Result<String> {
    let server = NameServer::of(server)?;
    let all = server.list().await?;
    let mut names: Vec<&String> = all.iter().filter(|name| name.contains("skin") && !name.ends_with(":i")).collect();
    names.sort();
    ensure!(!names.is_empty(), "none of the {} ports at {server} has `skin` in its name", all.len());
    let listening = |name: &String| tokio::spawn(listen(server.clone(), name.clone(), over));
    let heard: Vec<_> = names.iter().map(|name| listening(name)).collect();
    let mut lines = Vec::new();
    for (name, heard) in names.iter().zip(heard) {
        lines.push(format!("port {name}: {}", heard.await?));
    }
    lines.push("which boards these are, the robot's own files say: `taxeld setup`".to_owned());
    Ok(lines.join("\n"))
}

async fn listen(server: NameServer, name: String, over: Duration) -> String {
    let mut port = Port::default();
    let reading = async {
        let mut reader = PortReader::open(&server, &name).await?;
        loop {
            port.take(reader.next().await?.line, Instant::now());
        }
    };
    let ended: Result<Result<(), PortError>, _> = timeout(over, reading).await;
    match ended {
        Ok(Err(error)) => error.to_string(),
        _ => port.text(),
    }
}

/// What a port has sent.
#[derive(Default)]
struct Port {
    counts: Vec<u8>,
    before: Vec<u8>,
    /// Of each triangle, whether a value of it has changed.
    alive: Vec<bool>,
    messages: u32,
    times: Option<(Instant, Instant)>,
    /// Why it is no skin.
    other: Option<String>,
}

impl Port {
    fn take(&mut self, line: &[u8], now: Instant) {
        self.messages += 1;
        self.times = Some((self.times.map_or(now, |(first, _)| first), now));
        std::mem::swap(&mut self.before, &mut self.counts);
        self.other = read_counts(line, &mut self.counts).err().map(|unfit| unfit.to_string());
        self.alive.resize(self.counts.len() / VALUES, false);
        if self.before.len() == self.counts.len() {
            let triangles = self.before.chunks_exact(VALUES).zip(self.counts.chunks_exact(VALUES));
            self.alive.iter_mut().zip(triangles).for_each(|(alive, (before, now))| *alive |= before != now);
        }
    }

    fn text(&self) -> String {
        let Some((first, last)) = self.times else { return "nothing came".to_owned() };
        let rate = f64::from(self.messages - 1) / (last - first).as_secs_f64().max(1e-3);
        if let Some(why) = &self.other {
            return format!("{rate:.1} messages/s, no counts of skin: {why}");
        }
        let boards = self.alive.chunks(VALUES_PER_BOARD / VALUES).zip(1..).map(|(board, place)| {
            let alive = (0..).zip(board).filter(|(_, alive)| **alive);
            let alive = alive.map(|(triangle, _)| (Module::from_nibble(triangle), ModuleKind::Triangle));
            let alive = written_modules(&alive.collect::<Vec<_>>());
            format!("board {place}: {}", if alive.is_empty() { "none" } else { &alive })
        });
        let boards = boards.collect::<Vec<_>>().join("; ");
        format!("{} values, {rate:.1} messages/s; triangles alive: {boards}", self.counts.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_has_a_length_a_rate_and_triangles_that_change() {
        let (mut port, begin) = (Port::default(), Instant::now());
        for n in 0..11_u64 {
            let mut counts = vec![240_u64; 384];
            (counts[12 * 3], counts[12 * 4 + 11], counts[192]) = (n, n, 7 * n);
            let line: Vec<String> = counts.iter().map(|count| format!("{count}.0")).collect();
            port.take(line.join(" ").as_bytes(), begin + Duration::from_millis(20 * n));
        }
        assert_eq!(port.text(), "384 values, 50.0 messages/s; triangles alive: board 1: 3-4; board 2: 0");
        port.take(b"((1 2 3))", begin + Duration::from_millis(220));
        assert!(port.text().contains("no counts of skin: value 0 is \"((1\""), "{}", port.text());
        assert_eq!(Port::default().text(), "nothing came");
    }
}
