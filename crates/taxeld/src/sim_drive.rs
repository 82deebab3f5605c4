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

use crate::runtime;

/// How fast it goes to a set point.
const KPA_PER_S: f64 = 15.0;
/// How often it looks whether its time is over.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Listens on a free port of this machine, a connection after the other; what the pump is told comes out.
///
/// # Errors
/// If there is no port or no thread.
pub fn start() -> anyhow::Result<(SocketAddr, Receiver<PumpCommand>)> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let address = listener.local_addr()?;
    let (to, commands) = channel();
    runtime::start("sim-drive", move || {
        for stream in listener.incoming().flatten() {
            // The program is gone, and so is what held the pressure.
            if serve(stream, &to).is_err() && to.send(PumpCommand::Vent).is_err() {
                return;
            }
        }
    })?;
    Ok((address, commands))
}

fn serve(stream: TcpStream, to: &Sender<PumpCommand>) -> io::Result<()> {
    stream.set_read_timeout(Some(LOOK_EVERY))?;
    let (mut lines, mut answers) = (BufReader::new(stream.try_clone()?), stream);
    let (mut line, mut until) = (String::new(), None);
    loop {
        match lines.read_line(&mut line) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(_) => {
                let (answer, command, limit) = understood(line.trim());
                line.clear();
                if let Some(command) = command {
                    to.send(command).map_err(io::Error::other)?;
                    until = limit.map(|limit| Instant::now() + limit);
                }
                writeln!(answers, "{answer}")?;
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error),
        }
        if until.take_if(|until| Instant::now() > *until).is_some() {
            to.send(PumpCommand::Vent).map_err(io::Error::other)?;
        }
    }
}

/// The answer to a line, what the pump does, and for how long at most.
fn understood(line: &str) -> (String, Option<PumpCommand>, Option<Duration>) {
    let words: Vec<_> = line.split_whitespace().collect();
    let limit = |ms: &str| ms.parse().ok().map(Duration::from_millis);
    match words[..] {
        ["set", kpa, ms] => match (kpa.parse::<f64>(), limit(ms)) {
            (Ok(target), Some(limit)) if (0.0..=90.0).contains(&target) => {
                let ramp = PumpCommand::Ramp { target: Kilopascal(target), kpa_per_s: KPA_PER_S };
                (format!("ok set {kpa}"), Some(ramp), Some(limit))
            }
            _ => ("error: set KPA MS".to_owned(), None, None),
        },
        ["hold", ms] => match limit(ms) {
            Some(limit) => ("ok hold".to_owned(), Some(PumpCommand::Off), Some(limit)),
            None => ("error: hold MS".to_owned(), None, None),
        },
        ["vent"] => ("ok vent".to_owned(), Some(PumpCommand::Vent), None),
        _ => ("error: set, hold, vent".to_owned(), None, None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_point_that_nobody_repeats_is_vented() {
        let (address, commands) = start().unwrap();
        let mut line = TcpStream::connect(address).unwrap();
        let mut answers = BufReader::new(line.try_clone().unwrap()).lines();
        let mut tell = |text: &str| {
            writeln!(line, "{text}").unwrap();
            answers.next().unwrap().unwrap()
        };
        assert_eq!(tell("set 12.50 100"), "ok set 12.50");
        assert!(matches!(commands.recv().unwrap(), PumpCommand::Ramp { target, .. } if target.0 == 12.5));
        assert_eq!(commands.recv().unwrap(), PumpCommand::Vent, "its time is over");
        assert_eq!(tell("hold 60000"), "ok hold");
        assert_eq!(commands.recv().unwrap(), PumpCommand::Off);
        assert!(tell("set 200 100").starts_with("error"));
        drop((line, answers));
        assert_eq!(commands.recv().unwrap(), PumpCommand::Vent, "nobody is there any more");
    }
}
