//! The disk fails, the queue fills, the engine errs.

use std::sync::mpsc::Sender;

use super::fixture::*;
use crate::{Batch, Notify, QUEUE_BATCHES, QueueFull, Store, StoreError, StoreEvent};

/// A store with a session whose writer waits for a word.
fn held_store(notify: Notify) -> (Store, Sender<()>) {
    let (release, hold) = channel::<()>();
    let store = Store::in_memory(notify).unwrap();
    let (tell, told) = channel();
    let blocker = Box::new(move |_| {
        tell.send(()).unwrap();
        hold.recv().unwrap();
    });
    store.submit(Batch { records: vec![session(1, SessionState::Ramping)], on_durable: Some(blocker) }).unwrap();
    told.recv().unwrap(); // the writer is in the callback now
    (store, release)
}

#[test]
fn a_full_queue_is_told_and_never_waits() {
    let (store, release) = held_store(Box::new(|_| ()));
    for index in 0..QUEUE_BATCHES as u64 {
        store.submit(quiet(vec![sample_record(1, index)])).unwrap();
    }
    let QueueFull { batch, most } = store.submit(quiet(vec![sample_record(1, 9999)])).unwrap_err();
    assert!(matches!(batch.records[..], [Record::Sample { index: 9999, .. }]));
    assert_eq!(most, QUEUE_BATCHES);
    release.send(()).unwrap();
    store.close().unwrap();
}

/// What is read is answered whatever becomes of the store: by its writer, while that is behind, and when it is gone.
#[test]
fn whoever_reads_gets_an_answer_also_of_a_full_queue_and_of_no_store() {
    let (tell, told) = channel();
    let (store, release) = held_store(Box::new(|_| ()));
    let reader = store.reader();
    let ask = || {
        let [samples, set, audit, size] = std::array::from_fn(|_| tell.clone());
        reader.samples(1, Box::new(move |found| samples.send(found.map(drop)).unwrap()));
        reader.model_set("m-0".to_owned(), Box::new(move |found| set.send(found.map(drop)).unwrap()));
        reader.audit(u64::MAX, 9, Box::new(move |found| audit.send(found.map(drop)).unwrap()));
        reader.size(Box::new(move |found| size.send(found.map(drop)).unwrap()));
    };
    ask(); // before the queue is full
    for index in 0..QUEUE_BATCHES as u64 - 4 {
        store.submit(quiet(vec![sample_record(1, index)])).unwrap();
    }
    ask();
    let behind = Err(StoreError::Behind { waiting: QUEUE_BATCHES });
    assert_eq!(told.try_iter().collect::<Vec<_>>(), [(); 4].map(|()| behind.clone()));
    release.send(()).unwrap();
    store.close().unwrap();
    let no_set = Err(StoreError::NoModelSet("m-0".to_owned()));
    assert_eq!(told.try_iter().collect::<Vec<_>>(), [Ok(()), no_set, Ok(()), Ok(())]);
    ask();
    assert_eq!(told.try_iter().collect::<Vec<_>>(), [(); 4].map(|()| Err(StoreError::Closed)));
}

/// A disk that takes seconds for a flush keeps up all the same: all that came meanwhile goes with the next one.
#[test]
fn all_that_waits_for_a_slow_disk_goes_with_one_flush() {
    let (tell_event, events) = channel();
    let (store, release) = held_store(Box::new(move |event| drop(tell_event.send(event))));
    let waiting = QUEUE_BATCHES as u64;
    (0..waiting).for_each(|index| store.submit(quiet(vec![sample_record(1, index)])).unwrap());
    release.send(()).unwrap();
    store.close().unwrap();
    let stored: Vec<_> = events.iter().collect();
    assert_eq!(stored, [StoreEvent::Durable { session: 1, samples: waiting }]);
}

#[test]
fn a_batch_is_there_whole_or_not_at_all() {
    let (_dir, path) = place();
    let (store, ..) = open(&path);
    let set = model_set(1);
    let unknown = Record::Activated { patch: PATCH.to_owned(), model_set: "m-0".to_owned(), wall_ns: 0 };
    let records = vec![Record::ModelSet(Arc::new(set)), session(1, SessionState::Review), unknown];
    let refused = write(&store, records).unwrap_err();
    assert!(refused.to_string().contains("`m-0`"), "{refused}");
    assert_eq!(store.close(), Err(refused));
    let (_, restored, quarantined, _events) = open(&path);
    assert!(restored.model_sets.is_empty() && restored.sessions.is_empty() && quarantined.is_empty());
}

#[test]
fn records_that_do_not_follow_are_refused_with_the_reason() {
    let gap = vec![session(1, SessionState::Ramping), sample_record(1, 0), sample_record(1, 2)];
    let twice = vec![session(1, SessionState::Ramping), sample_record(1, 0), sample_record(1, 0)];
    let mut foreign = model_set(1);
    foreign.id = "m-0000000000000000".to_owned();
    let mut broken = model_set(1);
    broken.baseline[1].mean = f64::INFINITY;
    for (records, expected) in [
        (gap, "sample 2 of session 1 cannot be stored: sample 1 is the next one"),
        (twice, "sample 1 is the next one"),
        (vec![Record::ModelSet(Arc::new(foreign))], "m-0000000000000000"),
        (vec![Record::ModelSet(Arc::new(with_id(broken)))], "`baseline[1].mean`"),
    ] {
        let store = Store::in_memory(Box::new(|_| ())).unwrap();
        let refused = write(&store, records).unwrap_err().to_string();
        assert!(refused.contains(expected), "{refused}");
    }
}

/// A fault of this programme on the writer's thread.
#[test]
fn when_the_writers_thread_panics_everyone_who_waits_is_told_and_nothing_more_is_stored() {
    let (_dir, path) = place();
    let (store, _, _, events) = open(&path);
    let (release, hold) = channel::<()>();
    let (tell, told) = channel();
    let blocker: crate::OnDurable = Box::new(move |_| hold.recv().unwrap());
    store.submit(Batch { records: vec![session(1, SessionState::Ramping)], on_durable: Some(blocker) }).unwrap();
    let fault: crate::OnDurable = Box::new(|_| panic!("a fault that this test makes"));
    store.submit(Batch { records: vec![sample_record(1, 0)], on_durable: Some(fault) }).unwrap();
    for index in 1..4 {
        let tell = tell.clone();
        let on_durable: crate::OnDurable = Box::new(move |outcome| tell.send(outcome.map(|_| ())).unwrap());
        store.submit(Batch { records: vec![sample_record(1, index)], on_durable: Some(on_durable) }).unwrap();
    }
    let read = tell.clone();
    store.reader().samples(1, Box::new(move |samples| read.send(samples.map(|_| ())).unwrap()));
    release.send(()).unwrap();
    drop(tell);
    let answers: Vec<_> = told.iter().collect();
    assert_eq!(answers.len(), 4, "{answers:?}");
    assert!(answers.iter().all(Result::is_err), "{answers:?}");
    let later = write(&store, vec![sample_record(1, 4)]).unwrap_err();
    assert_eq!(later, StoreError::ReadOnly(StoreError::Panicked.to_string()));
    assert_eq!(store.close(), Err(StoreError::Panicked));
    let failures: Vec<_> = events.iter().filter(|event| matches!(event, StoreEvent::Failed(_))).collect();
    assert_eq!(failures, [StoreEvent::Failed(StoreError::Panicked.to_string())]);
}
