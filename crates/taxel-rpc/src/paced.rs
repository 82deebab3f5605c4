//! How fast a connection may send HTTP/2 frames that bring no call on: pings and their answers, settings, windows,
//! priorities, resets, data without content, what goes on about a call whose request has ended, and what no version knows.
//!
//! They cost the service's thread time and its reader nothing, and neither tonic nor h2 bounds them: one connection that
//! sent nothing else delayed the force of all others by tens of milliseconds. A reset may be that of a call that ended long
//! ago, and be sent again and again; those of calls that have just begun h2 bounds by itself. Of a call that was refused
//! before its request had ended, h2 skips for a second whatever still comes, and counts neither headers nor the ends of
//! requests. Whoever sends more is read more slowly, as the kernel holds back a sender whose bytes are not taken. Nothing
//! is lost by that, and an honest client never comes there: it gives a window back after many messages and answers a ping
//! in half a minute. What it sends answers what it was sent, so that a connection may send more the more it has taken; a
//! new one has little to say, else whoever connects again and again would begin anew each time.

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
/// Length of the head of a frame, RFC 9113 section 4.1: three bytes of length, one of type, one of flags, four of the stream.
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
/// The highest bit of a stream's number is reserved and does not count.
const STREAM_MAX: u32 = u32::MAX >> 1;

/// Where frames begin in what comes.
#[derive(Debug)]
struct Frames {
    /// Bytes until the next head.
    skip: usize,
    head: [u8; HEAD_BYTES],
    /// Of the head that has begun.
    have: usize,
    calls: Calls,
}

impl Frames {
    const fn new(calls_max: u32) -> Self {
        let calls = Calls { newest: 0, unended: 0, most: calls_max };
        Self { skip: PREFACE_BYTES, head: [0; HEAD_BYTES], have: 0, calls }
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
                let [high, middle, low, kind, flags, stream @ ..] = self.head;
                (self.skip, self.have) = (u32::from_be_bytes([0, high, middle, low]) as usize, 0);
                let stream = u32::from_be_bytes(stream) & STREAM_MAX;
                frames += u32::from(!self.calls.are_brought_on(kind, flags, stream, self.skip));
            }
        }
    }
}

/// What is known of the calls of a connection.
#[derive(Debug)]
struct Calls {
    /// The stream of the newest. Those of a client only rise, RFC 9113 section 5.1.1.
    newest: u32,
    /// Requests that may still end by a frame of data. One that ends otherwise, by a reset or by trailers, is not taken out.
    unended: u32,
    /// As many of these as a client may have calls at once, so that none can be saved up.
    most: u32,
}

impl Calls {
    /// Whether a frame brings one of them on.
    fn are_brought_on(&mut self, kind: u8, flags: u8, stream: u32, length: usize) -> bool {
        let ends = flags & END_STREAM != 0;
        match kind {
            HEADERS if stream > self.newest => {
                self.newest = stream;
                self.unended = (self.unended + u32::from(!ends)).min(self.most);
                true
            }
            // Trailers, which gRPC's clients do not send.
            HEADERS => false,
            // h2 takes five after one HEADERS, and closes the connection for a sixth.
            CONTINUATION => true,
            // Also with content: h2 bounds small frames of data, and not those that end a request.
            DATA if ends => {
                let may_end = self.unended > 0;
                self.unended = self.unended.saturating_sub(1);
                may_end
            }
            DATA => length > 0,
            _ => false,
        }
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
    /// Of a connection that may have `calls_max` calls at once.
    pub(crate) fn new(io: T, rate: Rate, calls_max: u32) -> Self {
        let left = AT_FIRST.min(rate.burst.into());
        Self { io, rate, frames: Frames::new(calls_max), left, at: Instant::now(), pause: None }
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

    const CALLS_MAX: u32 = 3;

    fn frame(kind: u8, payload: usize) -> Vec<u8> {
        frame_of(0, kind, 0, payload)
    }

    fn frame_of(stream: u32, kind: u8, flags: u8, payload: usize) -> Vec<u8> {
        let [_, high, middle, low] = u32::try_from(payload).unwrap().to_be_bytes();
        let mut frame = vec![high, middle, low, kind, flags];
        frame.extend(stream.to_be_bytes());
        frame.resize(HEAD_BYTES + payload, kind);
        frame
    }

    /// How many of these frames, each of a stream, a kind, flags and a length, are of no call.
    fn of_no_call(frames: &[(u32, u8, u8, usize)]) -> u32 {
        let bytes = frames.iter().flat_map(|&(stream, kind, flags, payload)| frame_of(stream, kind, flags, payload));
        Frames::new(CALLS_MAX).of_no_call(&PREFACE.iter().copied().chain(bytes).collect::<Vec<u8>>())
    }

    #[test]
    fn frames_of_no_call_are_counted_however_their_bytes_come() {
        let kinds =
            [(4, 18), (1, 300), (0, 70_000), (PING, 8), (8, 4), (9, 10), (3, 4), (2, 5), (99, 0), (0, 0), (PING, 8)];
        let last = frame_of(1, DATA, END_STREAM, 0);
        let frames = kinds.iter().map(|&(kind, payload)| frame_of(1, kind, 0, payload)).chain([last, frame(PING, 8)]);
        let bytes: Vec<u8> = PREFACE.iter().copied().chain(frames.flatten()).collect();
        for piece in [1, 2, 9, 10, 1000, bytes.len()] {
            let mut frames = Frames::new(CALLS_MAX);
            let found: u32 = bytes.chunks(piece).map(|piece| frames.of_no_call(piece)).sum();
            assert_eq!(found, 9, "in pieces of {piece} bytes");
        }
    }

    #[test]
    fn headers_bring_a_call_on_if_their_stream_is_a_new_one() {
        assert_eq!(of_no_call(&[(1, HEADERS, 0, 9), (3, HEADERS, END_STREAM, 9), (2_001, HEADERS, 0, 9)]), 0);
        let again = [(5, HEADERS, 0, 9), (5, HEADERS, END_STREAM, 0), (5, HEADERS, 0, 1), (3, HEADERS, 0, 9)];
        assert_eq!(of_no_call(&again), 3);
        let reserved = 1 << 31;
        assert_eq!(of_no_call(&[(5, HEADERS, 0, 9), (reserved | 5, HEADERS, 0, 9), (7, HEADERS, 0, 9)]), 1);
        assert_eq!(of_no_call(&[(1, HEADERS, 0, 9), (1, CONTINUATION, 0, 9), (1, CONTINUATION, 4, 9)]), 0);
    }

    #[test]
    fn a_request_ends_once_with_content_or_without() {
        for length in [0, 1, 1_000] {
            let end = (1, DATA, END_STREAM, length);
            assert_eq!(of_no_call(&[(1, HEADERS, 0, 9), (1, DATA, 0, 100), end]), 0, "{length} bytes");
            assert_eq!(of_no_call(&[(1, HEADERS, 0, 9), end, end, end]), 2, "{length} bytes");
            assert_eq!(of_no_call(&[(1, HEADERS, END_STREAM, 9), end]), 1, "{length} bytes, after the end");
        }
    }

    #[test]
    fn ends_of_requests_cannot_be_saved_up() {
        let calls = (0..100).map(|n| (2 * n + 1, HEADERS, 0, 9));
        let ends = [(1, DATA, END_STREAM, 0); 100];
        assert_eq!(of_no_call(&calls.chain(ends).collect::<Vec<_>>()), 100 - CALLS_MAX);
    }

    #[tokio::test(start_paused = true)]
    async fn whoever_sends_pings_alone_is_read_at_the_rate_and_loses_nothing() {
        let (near, mut far) = tokio::io::duplex(1 << 20);
        let rate = Rate { burst: 100, every: Duration::from_millis(10) }; // less than what is usual at first
        let mut paced = Paced::new(near, rate, CALLS_MAX);
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
        let mut paced = Paced::new(near, rate, CALLS_MAX);
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
        let paced = Paced::new(near, Rate { burst: 2_000, every: Duration::from_secs(3_600) }, CALLS_MAX);
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
        let mut paced = Paced::new(near, Rate { burst: 1, every: Duration::from_secs(60) }, CALLS_MAX);
        let begun = Instant::now();
        far.write_all(PREFACE).await.unwrap();
        // As many at once as may be: each ends its request with its only message, or by itself after several.
        for first in (1..600).step_by(2 * CALLS_MAX as usize) {
            let streams = || (0..CALLS_MAX).map(|call| first + 2 * call);
            for stream in streams() {
                far.write_all(&frame_of(stream, HEADERS, 0, 20)).await.unwrap();
            }
            for stream in streams().rev() {
                if stream % 4 == 1 {
                    far.write_all(&frame_of(stream, DATA, END_STREAM, 1_000)).await.unwrap();
                } else {
                    far.write_all(&frame_of(stream, DATA, 0, 1_000)).await.unwrap();
                    far.write_all(&frame_of(stream, DATA, END_STREAM, 0)).await.unwrap();
                }
            }
        }
        drop(far);
        paced.read_to_end(&mut Vec::new()).await.unwrap();
        assert_eq!(begun.elapsed(), Duration::ZERO);
    }
}
