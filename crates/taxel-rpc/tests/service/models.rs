//! Model sets that are on disk alone.

use std::sync::Mutex;

use taxel_engine::known_set::{KnownSet, SetSummary};

use crate::fixture::*;

fn damaged(id: String) -> Refusal {
    Refusal::failed_precondition(v1::ErrorReason::DataDamaged, format!("model set {id} is damaged on disk"))
}

/// Of three listed sets one is in memory; of the others the store has one, and the other is damaged there.
#[tokio::test]
async fn a_set_that_is_not_in_memory_is_listed_as_ever_and_read_when_it_is_asked_for() {
    let asked: Arc<Mutex<Vec<String>>> = Arc::default();
    let note = Arc::clone(&asked);
    let source = move |id: String, told: Told<String>| {
        note.lock().unwrap().push(id.clone());
        told(if id == "m-1" { Ok(format!("set {id}")) } else { Err(damaged(id)) });
    };
    let daemon = start_backed(Store { model_sets: Some(Box::new(source)), ..Store::default() }, patient()).await;
    let stored = |id: &str| KnownSet::stored(SetSummary::of(&model_set(id, FOREARM)));
    let active = vec![(FOREARM.to_owned(), Some("m-3".to_owned()))];
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let model_sets = vec![stored("m-1"), stored("m-2"), model_set("m-3", FOREARM).into()];
    daemon.engine().catalogue(Arc::new(Catalogue { model_sets, active, ..Catalogue::default() }));
    let request = v1::ListRequest { most: 2, ..Default::default() };
    let list = client.list_model_sets(request).await.unwrap().into_inner().model_sets;
    let shown: Vec<_> = list.iter().map(|set| (set.model_set.as_str(), set.active)).collect();
    assert_eq!(shown, [("m-3", true), ("m-2", false)], "the newest first");
    assert_eq!(list[1].method, model_set("m-2", FOREARM).method);
    assert!(asked.lock().unwrap().is_empty(), "a list reads no set");
    let request = |id: &str| v1::GetModelSetRequest { model_set: id.to_owned(), ..Default::default() };
    for id in ["m-1", "m-3", "m-1"] {
        let set = client.get_model_set(request(id)).await.unwrap().into_inner();
        assert_eq!((set.summary.unwrap().model_set.as_str(), set.taxels.len()), (id, TAXELS));
    }
    assert_eq!(*asked.lock().unwrap(), ["m-1", "m-1"], "one in memory is not read");
    let status = client.get_model_set(request("m-2")).await.unwrap_err();
    assert!(status.code() == Code::FailedPrecondition && status.message().contains("damaged on disk"), "{status:?}");
}
