//! What no daemon can be quicker than here: a few hundred bytes over loopback TCP between two threads that sleep.

use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::time::Duration;

use taxel_can::ClockReading;

/// About as long as a force message in its HTTP/2 frame.
const BYTES: usize = 192;

/// Delays in us of `messages` messages, one a `period`. Who sleeps longer wakes more slowly: the period is part of the floor.
///
/// # Errors
/// If loopback TCP does not work.
pub fn one_way_us(messages: usize, period: Duration) -> anyhow::Result<Vec<f64>> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
    let mut sender = TcpStream::connect(listener.local_addr()?)?;
    sender.set_nodelay(true)?;
    let (mut receiver, _) = listener.accept()?;
    let sending = std::thread::spawn(move || {
        let mut message = [0_u8; BYTES];
        for _ in 0..messages {
            std::thread::sleep(period);
            message[..8].copy_from_slice(&ClockReading::now().time.as_nanos().to_le_bytes());
            sender.write_all(&message)?;
        }
        Ok::<(), std::io::Error>(())
    });
    let mut delays = Vec::with_capacity(messages);
    let mut message = [0_u8; BYTES];
    while delays.len() < messages {
        receiver.read_exact(&mut message)?;
        let now = ClockReading::now().time.as_nanos();
        let mut sent = [0_u8; 8];
        sent.copy_from_slice(&message[..8]);
        delays.push((now - i64::from_le_bytes(sent)) as f64 * 1e-3);
    }
    sending.join().map_err(|_| anyhow::anyhow!("the sending thread panicked"))??;
    Ok(delays)
}
