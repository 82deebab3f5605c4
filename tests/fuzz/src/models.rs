//! MODELS.json.

use taxel_store::models_json::{content_id, from_json, to_json};

/// A text: what is taken in can be written, is read again as the same, and evaluates to finite figures.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let set = match from_json(text) {
        Ok(set) => set,
        Err(error) => {
            let said = error.to_string();
            assert!(!said.is_empty() && said.len() < 4_000, "{} bytes: {said}", said.len());
            return;
        }
    };
    assert!(set.taxels.len() <= text.len() && set.baseline.len() == set.taxels.len());
    let written = to_json(&set).expect("what was read can be written");
    let again = from_json(&written).expect("what was written is read");
    // Equal text is equal bits, and NaN equals itself.
    assert_eq!(format!("{again:?}"), format!("{set:?}"));
    assert_eq!(to_json(&again).as_ref(), Ok(&written));
    assert_eq!(content_id(&again), content_id(&set));
    for model in &set.taxels {
        for count in [0.0, 1.0, 127.5, 240.0, 255.0, 65_535.0] {
            if let Some(reading) = model.evaluate(count) {
                assert!(!reading.kpa.is_nan(), "{model:?} at {count}");
            }
        }
    }
}
