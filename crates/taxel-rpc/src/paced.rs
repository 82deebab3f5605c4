//! How fast a connection may send HTTP/2 frames that bring no call on: pings and their answers, settings, windows,
//! priorities, resets, data without content, and what no version knows.
//!
//! They cost the service's thread time and its reader nothing, and neither tonic nor h2 bounds them: one connection that
//! sent nothing else delayed the force of all others by tens of milliseconds. A reset may be that of a call that ended long
//! ago, and be sent again and again; those of calls that have just begun h2 bounds by itself. Whoever sends more is read more
//! slowly, as the kernel holds back a sender whose bytes are not taken. Nothing is lost by that, and an honest client never comes
//! there: it gives a window back after many messages and answers a ping in half a minute. What it sends answers what it was sent, so
//! that a connection may send more the more it has taken; a new one has little to say, else whoever connects again and again would
//! begin anew each time.

use std::future::Future;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, Waker, ready};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Instant, Sleep};

use crate::limits::Rate;

/// Length of the client's preface, RFC 9113 section 3.4.
pub(crate) const PREFACE_BYTES: usize = 24;
/// Length of the head of a frame, RFC 9113 section 4.1: three bytes of length, one of type, and what is not needed here.
const HEAD_BYTES: usize = 9;
/// So many such frames a new connection may send at once: settings, windows, some pings.
const AT_FIRST: f64 = 200.0;
/// For so many bytes that it takes it may send one more. Whoever asks to be answered (a ping and its answer have 17 bytes) gets
/// less for it than it cost.
const BYTES_A_FRAME: f64 = 64.0;
/// Types of frames that bring calls on, RFC 9113 section 6. Calls have limits of their own.
const DATA: u8 = 0;
const HEADERS: u8 = 1;
const CONTINUATION: u8 = 9;
/// The flag of the last frame of a request.
const END_STREAM: u8 = 1;

/// Where frames begin in what comes.
#[derive(Debug)]
struct Frames {
    /// Bytes until the next head.
    skip: usize,
    head: [u8; HEAD_BYTES],
    /// Of the head that has begun.
    have: usize,
}

impl Frames {
    const fn new() -> Self {
        Self { skip: PREFACE_BYTES, head: [0; HEAD_BYTES], have: 0 }
    }

    /// How many frames of no call begin in these bytes, which follow those before.
    fn of_no_call(&mut self, mut bytes: &[u8]) -> u32 {
        let mut frames = 0;
        loop {
            let skipped = self.skip.min(bytes.len());
            (self.skip, bytes) = (self.skip - skipped, &bytes[skipped..]);
            if bytes.is_empty() {
                return frames;
            }
            let taken = (HEAD_BYTES - self.have).min(bytes.len());
            self.head[self.have..self.have + taken].copy_from_slice(&bytes[..taken]);
            (self.have, bytes) = (self.have + taken, &bytes[taken..]);
            if self.have == HEAD_BYTES {
                let [high, middle, low, kind, flags, ..] = self.head;
                (self.skip, self.have) = (u32::from_be_bytes([0, high, middle, low]) as usize, 0);
                frames += u32::from(!brings_a_call_on(kind, flags, self.skip));
            }
        }
    }
}

const fn brings_a_call_on(kind: u8, flags: u8, length: usize) -> bool {
    match kind {
        DATA => length > 0 || flags & END_STREAM != 0,
        HEADERS | CONTINUATION => true,
        _ => false,
    }
}

/// A socket that is read no faster than at the rate of such frames.
pub(crate) struct Paced<T> {
    io: T,
    rate: Rate,
    frames: Frames,
    /// How many may come at once, as of `at`; never more than the burst of the rate.
    left: f64,
    at: Instant,
    /// Until there is one again.
    pause: Option<Pause>,
}

/// A reader is held back.
struct Pause {
    over: Pin<Box<Sleep>>,
    /// Whoever waits for that. A connection reads before it writes and then sleeps, so that a pause which a write ends has to
    /// be told.
    reader: Option<Waker>,
}

impl Pause {
    fn of(time: Duration) -> Self {
        Self { over: Box::pin(tokio::time::sleep(time)), reader: None }
    }

    fn poll(&mut self, cx: &mut Context<'_>) -> Poll<()> {
        self.reader = Some(cx.waker().clone());
        self.over.as_mut().poll(cx)
    }
}

impl<T> Paced<T> {
    pub(crate) fn new(io: T, rate: Rate) -> Self {
        Self { io, rate, frames: Frames::new(), left: AT_FIRST.min(rate.burst.into()), at: Instant::now(), pause: None }
    }

    /// So many frames have come; how long to wait with the next ones.
    fn take(&mut self, frames: u32, now: Instant) -> Option<Duration> {
        let (burst, every_s) = (f64::from(self.rate.burst), self.rate.every.as_secs_f64());
        let since = now.saturating_duration_since(self.at).as_secs_f64();
        self.left = (self.left + since / every_s).min(burst) - f64::from(frames);
        self.at = now;
        (self.left < 0.0).then(|| Duration::from_secs_f64(-self.left * every_s))
    }
}

impl<T: AsyncRead + Unpin> AsyncRead for Paced<T> {
    fn poll_read(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        if let Some(pause) = &mut self.pause {
            ready!(pause.poll(cx));
            self.pause = None;
        }
        let before = buf.filled().len();
        ready!(Pin::new(&mut self.io).poll_read(cx, buf))?;
        let frames = self.frames.of_no_call(&buf.filled()[before..]);
        if frames > 0 {
            self.pause = self.take(frames, Instant::now()).map(Pause::of);
        }
        Poll::Ready(Ok(()))
    }
}

impl<T: AsyncWrite + Unpin> AsyncWrite for Paced<T> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, buf: &[u8]) -> Poll<io::Result<usize>> {
        let written = ready!(Pin::new(&mut self.io).poll_write(cx, buf))?;
        self.left = (self.left + written as f64 / BYTES_A_FRAME).min(self.rate.burst.into());
        if self.left >= 0.0
            && let Some(reader) = self.pause.take().and_then(|pause| pause.reader)
        {
            reader.wake();
        }
        Poll::Ready(Ok(written))
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_shutdown(cx)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    use super::*;

    const PREFACE: &[u8; PREFACE_BYTES] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
    const PING: u8 = 6;

    fn frame(kind: u8, payload: usize) -> Vec<u8> {
        let [_, high, middle, low] = u32::try_from(payload).unwrap().to_be_bytes();
        let mut frame = vec![high, middle, low, kind, 0, 0, 0, 0, 0];
        frame.resize(HEAD_BYTES + payload, kind);
        frame
    }

    #[test]
    fn frames_of_no_call_are_counted_however_their_bytes_come() {
        let kinds =
            [(4, 18), (1, 300), (0, 70_000), (PING, 8), (8, 4), (9, 10), (3, 4), (2, 5), (99, 0), (0, 0), (PING, 8)];
        let mut last = frame(DATA, 0);
        last[4] = END_STREAM;
        let frames = kinds.iter().map(|&(kind, payload)| frame(kind, payload)).chain([last, frame(PING, 8)]);
        let bytes: Vec<u8> = PREFACE.iter().copied().chain(frames.flatten()).collect();
        for piece in [1, 2, 9, 10, 1000, bytes.len()] {
            let mut frames = Frames::new();
            let found: u32 = bytes.chunks(piece).map(|piece| frames.of_no_call(piece)).sum();
            assert_eq!(found, 9, "in pieces of {piece} bytes");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn whoever_sends_pings_alone_is_read_at_the_rate_and_loses_nothing() {
        let (near, mut far) = tokio::io::duplex(1 << 20);
        let rate = Rate { burst: 100, every: Duration::from_millis(10) }; // less than what is usual at first
        let mut paced = Paced::new(near, rate);
        let begun = Instant::now();
        far.write_all(PREFACE).await.unwrap();
        let mut sent = PREFACE.to_vec();
        for _ in 0..1_100 {
            let ping = frame(PING, 8);
            far.write_all(&ping).await.unwrap();
            sent.extend(ping);
        }
        drop(far);
        let (mut got, mut piece) = (Vec::new(), [0; 170]);
        loop {
            let bytes = paced.read(&mut piece).await.unwrap();
            if bytes == 0 {
                break;
            }
            got.extend_from_slice(&piece[..bytes]);
        }
        assert!(got == sent, "{} bytes of {}", got.len(), sent.len());
        let took = begun.elapsed().as_secs_f64();
        assert!((9.8..=10.2).contains(&took), "a thousand beyond the burst took {took} s, each 10 ms");
    }

    /// Sends so many pings and reads until all have come; how long that took.
    async fn time_of(
        paced: &mut Paced<tokio::io::DuplexStream>,
        far: &mut tokio::io::DuplexStream,
        pings: usize,
    ) -> f64 {
        let begun = Instant::now();
        far.write_all(&frame(PING, 8).repeat(pings)).await.unwrap();
        let mut bytes = vec![0; 17 * pings];
        // Byte by byte, since what is read together is counted together.
        for byte in &mut bytes {
            *byte = paced.read_u8().await.unwrap();
        }
        begun.elapsed().as_secs_f64()
    }

    #[tokio::test(start_paused = true)]
    async fn a_new_connection_has_little_to_say_and_may_say_more_the_more_it_takes() {
        let rate = Rate { burst: 2_000, every: Duration::from_millis(10) };
        let (near, mut far) = tokio::io::duplex(1 << 20);
        let mut paced = Paced::new(near, rate);
        far.write_all(PREFACE).await.unwrap();
        paced.read_exact(&mut PREFACE.to_vec()).await.unwrap();
        assert_eq!(time_of(&mut paced, &mut far, 200).await, 0.0);
        assert!((0.98..=1.0).contains(&time_of(&mut paced, &mut far, 100).await), "the rate is 100 a second");
        let half = vec![0; 64 * 1_000];
        for taken in 0..6 {
            paced.write_all(&half).await.unwrap();
            far.read_exact(&mut half.clone()).await.unwrap();
            assert!(paced.left <= 2_000.0, "{taken}");
        }
        assert!(time_of(&mut paced, &mut far, 1_990).await < 0.02, "it has taken a lot");
        // What it takes while it is held back counts at once.
        far.write_all(&frame(PING, 8).repeat(500)).await.unwrap();
        paced.read_exact(&mut vec![0; 17 * 500]).await.unwrap();
        assert!(tokio::time::timeout(Duration::from_secs(1), paced.read_u8()).await.is_err(), "it is held back");
        far.write_all(&frame(PING, 8)).await.unwrap();
        paced.write_all(&half).await.unwrap();
        far.read_exact(&mut half.clone()).await.unwrap();
        assert_eq!(time_of(&mut paced, &mut far, 1).await, 0.0);
        paced.left = 0.0;
        assert!((0.9..=1.1).contains(&time_of(&mut paced, &mut far, 110).await), "and no more than the burst");
    }

    #[tokio::test(start_paused = true)]
    async fn whoever_waits_for_the_end_of_a_pause_hears_that_a_write_ended_it() {
        let (near, mut far) = tokio::io::duplex(1 << 20);
        let paced = Paced::new(near, Rate { burst: 2_000, every: Duration::from_secs(3_600) });
        far.write_all(PREFACE).await.unwrap();
        far.write_all(&frame(PING, 8).repeat(210)).await.unwrap();
        let (mut reading, mut writing) = tokio::io::split(paced);
        reading.read_exact(&mut vec![0; PREFACE.len() + 17 * 210]).await.unwrap();
        far.write_all(b"x").await.unwrap();
        let begun = Instant::now();
        let waiting = tokio::spawn(async move { reading.read_u8().await });
        tokio::task::yield_now().await;
        assert!(!waiting.is_finished(), "it is held back");
        let answer = vec![0; 64 * 20];
        writing.write_all(&answer).await.unwrap();
        assert_eq!(waiting.await.unwrap().unwrap(), b'x');
        assert_eq!(begun.elapsed(), Duration::ZERO);
    }

    #[tokio::test(start_paused = true)]
    async fn calls_are_read_as_fast_as_they_come() {
        let (near, mut far) = tokio::io::duplex(1 << 20);
        let mut paced = Paced::new(near, Rate { burst: 1, every: Duration::from_secs(60) });
        let begun = Instant::now();
        far.write_all(PREFACE).await.unwrap();
        for _ in 0..100 {
            far.write_all(&frame(1, 20)).await.unwrap();
            far.write_all(&frame(0, 1_000)).await.unwrap();
        }
        drop(far);
        paced.read_to_end(&mut Vec::new()).await.unwrap();
        assert_eq!(begun.elapsed(), Duration::ZERO);
    }
}
