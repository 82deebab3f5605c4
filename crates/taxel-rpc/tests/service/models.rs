//! What a session over both branches knows beyond its curves goes out too.

use std::sync::Arc;
use taxel_engine::command::{Command, Done, Rejection};
use taxel_engine::model_set::{ModelSet, Recorded, RecordedTaxel};
use taxel_engine::snapshot::Catalogue;
use taxel_model::{Plays, Sign};
use taxel_proto::v1;
use taxel_proto::v1::model_service_client::ModelServiceClient;
use tonic::Code;

use crate::fixture::{FOREARM, TAXELS, model_set, start};

fn over_both_branches(id: &str) -> ModelSet {
    let set = ModelSet::clone(&model_set(id, FOREARM));
    let curve = set.taxels[0].curve.clone().unwrap();
    let plays = Plays {
        curve,
        range: [180.0, 240.0],
        sign: Sign::Falling,
        radii_counts: [4.0, 10.0],
        weights_kpa: [0.5, 0.25],
    };
    let taxel = RecordedTaxel { rmse_kpa: 1.5, sensitivity: 0.9, hysteresis_kpa: Some(3.0), plays: Some(plays) };
    let mut taxels = vec![None; TAXELS];
    taxels[0] = Some(taxel);
    let recorded = Recorded {
        smooth_s: 0.5,
        module_size: 10,
        lag_s: -0.1,
        zero_return_counts: 0.4,
        zero_return_common_counts: None,
        clock: None,
        plays_error_ratio: Some(0.6),
        taxels,
    };
    ModelSet { recorded: Some(recorded), ..set }
}

#[tokio::test]
async fn hysteresis_and_quality_in_use_are_shown() {
    let daemon = start().await;
    let active = vec![(FOREARM.to_owned(), Some("m-both".to_owned()))];
    let model_sets = vec![model_set("m-rising", FOREARM), Arc::new(over_both_branches("m-both"))];
    daemon.engine().catalogue(Arc::new(Catalogue { model_sets, active, ..Catalogue::default() }));
    let mut client = ModelServiceClient::new(daemon.connect().await);

    let set = client.get_model_set(v1::GetModelSetRequest::default()).await.unwrap().into_inner();
    let in_use = set.in_use.unwrap();
    assert_eq!((in_use.smooth_s, in_use.lag_s, in_use.zero_return_counts), (0.5, -0.1, 0.4));
    assert_eq!((in_use.plays_error_ratio, in_use.taxels_with_plays), (Some(0.6), 1));
    let first = &set.taxels[0];
    assert_eq!((first.rmse_in_use_kpa, first.hysteresis_kpa, first.has_plays), (Some(1.5), Some(3.0), true));
    assert_eq!((set.taxels[1].rmse_in_use_kpa, set.taxels[1].has_plays), (None, false));

    let model = client.get_taxel_model(v1::GetTaxelModelRequest::default()).await.unwrap().into_inner();
    let plays = model.plays.unwrap();
    assert_eq!((plays.radii_counts, plays.weights_kpa), (vec![4.0, 10.0], vec![0.5, 0.25]));
    assert_eq!((plays.count_min, plays.count_max, plays.curve), (180.0, 240.0, model.curve));
    assert_eq!(model.quality.unwrap().sensitivity_counts_per_kpa, Some(0.9));

    let rising = v1::GetModelSetRequest { model_set: "m-rising".to_owned(), ..Default::default() };
    assert_eq!(client.get_model_set(rising).await.unwrap().into_inner().in_use, None);
}

#[tokio::test]
async fn a_deletion_reaches_the_engine_and_a_refusal_comes_back_with_its_words() {
    let mut daemon = start().await;
    let mut client = ModelServiceClient::new(daemon.connect().await);
    let request = || v1::DeleteModelSetRequest { model_set: "m-1".to_owned() };
    let named = |command| {
        let Command::DeleteModelSet { model_set } = command else { panic!("{command:?}") };
        assert_eq!(model_set, "m-1");
    };
    let (answer, ()) = tokio::join!(client.delete_model_set(request()), daemon.answer(Ok(Done::Deleted), named));
    answer.unwrap();
    let refusal = Err(Rejection::FailedPrecondition("model set `m-1` is in use".to_owned()));
    let (answer, ()) = tokio::join!(client.delete_model_set(request()), daemon.answer(refusal, named));
    let status = answer.unwrap_err();
    assert_eq!((status.code(), status.message()), (Code::FailedPrecondition, "model set `m-1` is in use"));
    let status = client.delete_model_set(v1::DeleteModelSetRequest::default()).await.unwrap_err();
    assert_eq!(status.code(), Code::InvalidArgument);
}
