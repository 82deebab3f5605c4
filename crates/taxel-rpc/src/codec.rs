//! How model sets become text: the service leaves that to whoever starts it.

use taxel_engine::model_set::ModelSet;

/// How model sets become files and come back.
#[derive(Clone, Copy, Debug)]
pub struct ModelCodec {
    /// The text of MODELS.json, or what of the set cannot be written.
    pub to_json: fn(&ModelSet) -> Result<String, String>,
    /// The set that such a text describes, or where it is wrong, what was found and what was expected.
    pub from_json: fn(&str) -> Result<ModelSet, String>,
    /// The same of a text from elsewhere, whose set is of no session of this daemon.
    pub from_elsewhere: fn(&str) -> Result<ModelSet, String>,
}
