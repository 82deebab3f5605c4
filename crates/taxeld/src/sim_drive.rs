//! The simulated pump of `taxeld demo --device`: a micro board as in deploy/rigs/micro.toml, on a port of this machine.
//!
//! Like the board it vents when it has been told nothing for as long as its last command said. What it leaves out: a dead time, a
//! dead band, a pump that comes to its end before the bag's model does.

use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

use taxel_sim::PumpCommand;
use taxel_skin::Kilopascal;
use tokio::sync::watch;

use crate::runtime;

/// How fast it goes to a set point.
const KPA_PER_S: f64 = 15.0;
/// How often it looks whether its time is over.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// The pump's end of the board.
pub struct Pump {
    /// What it is told.
    pub commands: Receiver<PumpCommand>,
    /// What the board's own gauge reads, kPa below ambient.
    pub gauge: watch::Sender<f64>,
}

/// Listens on a free port of this machine, a connection after the other.
///
/// # Errors
/// If there is no port or no thread.
pub fn start() -> anyhow::Result<(SocketAddr, Pump)> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let address = listener.local_addr()?;
    let (to, commands) = channel();
    let (gauge, own) = watch::channel(0.0);
    let board = Board { to, gauge: own };
    runtime::start("sim-drive", move || {
        for stream in listener.incoming().flatten() {
            // The program is gone, and so is what held the pressure.
            if board.serve(stream).is_err() && board.to.send(PumpCommand::Vent).is_err() {
                return;
            }
        }
    })?;
    Ok((address, Pump { commands, gauge }))
}

struct Board {
    to: Sender<PumpCommand>,
    gauge: watch::Receiver<f64>,
}

impl Board {
    fn serve(&self, stream: TcpStream) -> io::Result<()> {
        stream.set_read_timeout(Some(LOOK_EVERY))?;
        let (mut lines, mut answers) = (BufReader::new(stream.try_clone()?), stream);
        let (mut line, mut until) = (String::new(), None);
        let tell = |command| self.to.send(command).map_err(io::Error::other);
        loop {
            match lines.read_line(&mut line) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(_) => {
                    let (answer, told) = self.understood(line.trim());
                    line.clear();
                    if let Some((command, limit)) = told {
                        tell(command)?;
                        until = limit.map(|limit| Instant::now() + limit);
                    }
                    writeln!(answers, "{answer}")?;
                }
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
                Err(error) => return Err(error),
            }
            if until.take_if(|until| Instant::now() > *until).is_some() {
                tell(PumpCommand::Vent)?;
            }
        }
    }

    /// The answer to a line, what the pump does, and for how long at most.
    fn understood(&self, line: &str) -> (String, Option<(PumpCommand, Option<Duration>)>) {
        let words: Vec<_> = line.split_whitespace().collect();
        let limit = |ms: &str| ms.parse().ok().map(Duration::from_millis);
        let told = match words[..] {
            ["set", kpa, ms] => limit(ms)
                .zip(kpa.parse().ok())
                .filter(|(_, kpa)| (0.0..=90.0).contains(kpa))
                .map(|(limit, kpa)| (PumpCommand::Ramp { target: Kilopascal(kpa), kpa_per_s: KPA_PER_S }, Some(limit))),
            ["hold", ms] => limit(ms).map(|limit| (PumpCommand::Off, Some(limit))),
            ["vent"] => Some((PumpCommand::Vent, None)),
            ["get"] => return (format!("p {:.2}", *self.gauge.borrow()), None),
            _ => None,
        };
        let answer = match (told, &words[..]) {
            (Some(_), [word, kpa, _]) => format!("ok {word} {kpa}"),
            (Some(_), [word, ..]) => format!("ok {word}"),
            _ => "error: set KPA MS, hold MS, vent, get".to_owned(),
        };
        (answer, told)
    }
}
