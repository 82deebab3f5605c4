//! Answers on their way out: what one holds is let go when it is out, or when its reader takes nothing for too long.
//!
//! hyper asks a body for a frame before it knows that the peer has room for it, and does not ask again until there is room.
//! So a body never learns of a reader that makes none: all answers are looked at from outside, too.

use std::collections::HashMap;
use std::convert::Infallible;
use std::mem;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use http_body::Frame;
use taxel_proto::refusal::{Refusal, complete};
use taxel_proto::v1::ErrorReason;
use tokio::time::Instant;
use tonic::body::Body;
use tonic::codegen::http::HeaderMap;
use tonic::codegen::{Bytes, http};
use tonic::{Code, Response, Status};

use crate::guard::Peer;
use crate::refusals::Refusals;
use crate::shares::Place;

/// A larger frame goes out in pieces of this size, so that no more of an answer that nobody takes stays in HTTP/2.
const PIECE_BYTES: usize = 16 << 10;

/// Shortest time between two looks.
const LOOK_MIN: Duration = Duration::from_millis(1);

/// The same answer, which holds a place until it is out.
pub(crate) fn with_place<M>(message: M, place: Place) -> Response<M> {
    let mut answer = Response::new(message);
    answer.extensions_mut().insert(Arc::new(place));
    answer
}

/// All answers on their way.
pub(crate) struct Answers {
    all: Mutex<Registry>,
    unread: Duration,
    refusals: Arc<Refusals>,
}

#[derive(Default)]
struct Registry {
    under_way: HashMap<u64, Weak<Answer>>,
    /// So many were begun; the newest has this number.
    begun: u64,
}

impl Answers {
    /// An answer ends when nothing of it is taken for `unread`.
    pub(crate) fn new(unread: Duration, refusals: Arc<Refusals>) -> Arc<Self> {
        Arc::new(Self { all: Mutex::default(), unread, refusals })
    }

    /// The body of the answer to a call of `method`, under watch, with the place of that call.
    pub(crate) fn watch(
        self: &Arc<Self>,
        (method, peer): (&'static str, &Peer),
        answer: http::Response<Body>,
        place: Option<Place>,
    ) -> http::Response<Body> {
        let (mut head, body) = answer.into_parts();
        let places = Places { call: place, work: head.extensions.remove::<Arc<Place>>() };
        let state = State {
            body: Some(body),
            rest: Bytes::new(),
            places,
            offered: Some(Instant::now()),
            given_up: None,
            told: false,
        };
        let mut all = self.all();
        all.begun += 1;
        let number = all.begun;
        let (peer, answers) = (peer.clone(), Arc::clone(self));
        let answer = Arc::new(Answer { number, method, peer, answers, state: Mutex::new(state) });
        all.under_way.insert(number, Arc::downgrade(&answer));
        drop(all);
        http::Response::from_parts(head, Body::new(Held(answer)))
    }

    /// Gives up what nobody takes, for ever.
    pub(crate) async fn keep(&self) -> Infallible {
        loop {
            tokio::time::sleep((self.unread / 4).max(LOOK_MIN)).await;
            self.look(Instant::now());
        }
    }

    fn look(&self, now: Instant) {
        let answers: Vec<_> = self.all().under_way.values().filter_map(Weak::upgrade).collect();
        for answer in answers {
            answer.give_up(now, self.unread);
        }
    }

    fn all(&self) -> MutexGuard<'_, Registry> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What an answer holds beside itself.
#[derive(Default)]
struct Places {
    call: Option<Place>,
    /// For what it took to make it.
    work: Option<Arc<Place>>,
}

impl Places {
    const fn any(&self) -> bool {
        self.call.is_some() || self.work.is_some()
    }
}

/// One answer. It lives as long as its body and those of its bytes that HTTP/2 still has.
struct Answer {
    number: u64,
    method: &'static str,
    peer: Peer,
    answers: Arc<Answers>,
    state: Mutex<State>,
}

struct State {
    /// Absent once it has ended.
    body: Option<Body>,
    /// What is left of its last frame.
    rest: Bytes,
    places: Places,
    /// Since when it is the reader's turn; absent while there is nothing to take.
    offered: Option<Instant>,
    /// How long nothing was taken when this was given up.
    given_up: Option<Duration>,
    /// Whether the reader was told so.
    told: bool,
}

impl Answer {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets everything go if nothing was taken for `unread`.
    fn give_up(&self, now: Instant, unread: Duration) {
        let mut state = self.state();
        let waited = state.offered.map_or(Duration::ZERO, |offered| now.saturating_duration_since(offered));
        if waited <= unread {
            return;
        }
        (state.offered, state.given_up) = (None, Some(waited));
        let held = (state.body.take(), mem::take(&mut state.rest), mem::take(&mut state.places));
        drop(state);
        drop(held);
        self.peer.count_untaken();
        let (key, place) = (self.peer.origin.key(), self.peer.origin.place());
        self.answers.refusals.tell(("untaken", &key), || {
            let method = self.method;
            format!("an answer to {method} was given up: {place} took nothing of it for {:.1} s", waited.as_secs_f64())
        });
    }

    /// How an answer ends that was given up, for a reader that takes something again.
    fn end(&self, waited: Duration) -> HeaderMap {
        let (waited, limit) = (waited.as_secs_f64(), self.answers.unread.as_secs_f64());
        let text = format!("nothing of the answer was taken for {waited:.1} s, the limit is {limit} s; ask again");
        let mut trailers = HeaderMap::new();
        // What it could not be written as would be an answer without a status, which a client takes for a failure.
        let _ = Status::from(Refusal::new(Code::Aborted, ErrorReason::ReaderTooSlow, text)).add_header(&mut trailers);
        trailers
    }
}

impl Drop for Answer {
    fn drop(&mut self) {
        self.answers.all().under_way.remove(&self.number);
        if self.state().given_up.is_some() {
            self.peer.count_taken();
        }
    }
}

/// The body of an answer.
struct Held(Arc<Answer>);

/// Bytes of an answer, which holds its places until they are out.
struct Carried(Bytes, #[expect(dead_code, reason = "lives as long as the bytes")] Arc<Answer>);

impl AsRef<[u8]> for Carried {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl Held {
    /// Data for the reader, at most a piece.
    fn data(&self, state: &mut State, data: Bytes) -> Frame<Bytes> {
        state.rest = data;
        let piece = if state.rest.len() <= PIECE_BYTES {
            mem::take(&mut state.rest)
        } else {
            Bytes::copy_from_slice(&state.rest.split_to(PIECE_BYTES)) // and not a share of the whole
        };
        let carried = state.places.any().then(|| Arc::clone(&self.0));
        Frame::data(match carried {
            Some(answer) => Bytes::from_owner(Carried(piece, answer)),
            None => piece,
        })
    }
}

impl http_body::Body for Held {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        let mut state = self.0.state();
        let state = &mut *state;
        state.offered = None;
        if !state.rest.is_empty() {
            state.offered = Some(Instant::now());
            let rest = mem::take(&mut state.rest);
            return Poll::Ready(Some(Ok(self.data(state, rest))));
        }
        let Some(body) = &mut state.body else {
            let untold = state.given_up.filter(|_| !mem::replace(&mut state.told, true));
            return Poll::Ready(untold.map(|waited| Ok(Frame::trailers(self.0.end(waited)))));
        };
        let frame = ready!(Pin::new(body).poll_frame(cx));
        state.offered = Some(Instant::now());
        Poll::Ready(match frame {
            Some(Ok(frame)) => Some(Ok(match frame.into_data() {
                Ok(data) => self.data(state, data),
                Err(mut frame) => {
                    state.body = None;
                    frame.trailers_mut().map(complete);
                    frame
                }
            })),
            ended => {
                state.body = None;
                ended
            }
        })
    }

    fn is_end_stream(&self) -> bool {
        let state = self.0.state();
        let ended = state.body.as_ref().is_none_or(http_body::Body::is_end_stream);
        ended && state.rest.is_empty() && (state.given_up.is_none() || state.told)
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        let mut state = self.0.state();
        let held = (state.body.take(), mem::take(&mut state.rest));
        drop(state);
        drop(held);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::origin::PeerKey;
    use crate::limits::Limits;
    use crate::shares::{Shares, What};
    use http_body_util::{BodyExt, Full};

    fn peer() -> Peer {
        Peer { origin: Arc::new(crate::access::origin::Origin::of_tcp(([127, 0, 0, 1], 1).into())), ward: None }
    }

    /// An answer of so many bytes that has the only place.
    fn answer(bytes: usize) -> (Arc<Answers>, Arc<Shares>, Body) {
        let answers = Answers::new(Duration::from_secs(1), Arc::default());
        let shares = Shares::new(&Limits { calls: 1, calls_per_peer: 1, ..Limits::default() });
        let place = shares.take(What::Call, PeerKey::User(1), true).unwrap();
        let body = Body::new(Full::new(Bytes::from(vec![7; bytes])));
        let body = answers.watch(("test", &peer()), http::Response::new(body), Some(place)).into_body();
        (answers, shares, body)
    }

    fn is_free(shares: &Arc<Shares>) -> bool {
        shares.room(What::Call, &PeerKey::User(1), true).is_ok()
    }

    #[tokio::test]
    async fn an_answer_goes_out_whole_in_pieces_and_its_place_is_free_when_the_last_byte_is_out() {
        let (answers, shares, mut body) = answer(2 * PIECE_BYTES + 1);
        let mut pieces = Vec::new();
        while let Some(frame) = body.frame().await {
            pieces.push(frame.unwrap().into_data().unwrap());
        }
        assert_eq!(pieces.iter().map(Bytes::len).collect::<Vec<_>>(), [PIECE_BYTES, PIECE_BYTES, 1]);
        drop(body);
        assert!(!is_free(&shares), "HTTP/2 still has its bytes");
        drop(pieces);
        assert!(is_free(&shares) && answers.all().under_way.is_empty());
    }

    #[tokio::test]
    async fn of_an_answer_that_nobody_takes_nothing_is_kept_and_its_reader_is_told() {
        let (answers, shares, mut body) = answer(2 * PIECE_BYTES);
        let first = body.frame().await.unwrap().unwrap().into_data().unwrap();
        answers.look(Instant::now());
        assert!(!is_free(&shares), "it is not late yet");
        answers.look(Instant::now() + Duration::from_secs(2));
        assert!(is_free(&shares));
        let end = body.frame().await.unwrap().unwrap().into_trailers().unwrap();
        let status = Status::from_header_map(&end).unwrap();
        assert_eq!(status.code(), Code::Aborted);
        assert!(status.message().contains("the limit is 1 s"), "{status:?}");
        assert_eq!(taxel_proto::refusal::reason_of(&status).as_deref(), Some("READER_TOO_SLOW"));
        assert!(body.frame().await.is_none());
        drop((first, body));
        assert!(answers.all().under_way.is_empty());
    }

    #[tokio::test]
    async fn an_answer_that_has_nothing_to_give_is_nobodys_delay() {
        let answers = Answers::new(Duration::from_secs(1), Arc::default());
        let (_values, waiting) = tokio::sync::mpsc::channel::<Result<Frame<Bytes>, Status>>(1);
        let body = Body::new(http_body_util::StreamBody::new(tokio_stream::wrappers::ReceiverStream::new(waiting)));
        let mut body = answers.watch(("test", &peer()), http::Response::new(body), None).into_body();
        assert!(futures_util::poll!(body.frame()).is_pending());
        answers.look(Instant::now() + Duration::from_secs(3600));
        assert!(futures_util::poll!(body.frame()).is_pending());
    }
}
