//! What is known of the skin, as it is shown.

use std::collections::VecDeque;
use std::time::Duration;

use taxel_client::{Moment, Received};
use taxel_proto::v1::{Event, Health, Skin, TaxelReading, TaxelSample};
use taxel_skin::flat;

/// Of so long a time each bar of the course shows the greatest force.
pub const BAR: Duration = Duration::from_millis(250);
/// Bars that are kept: as wide as a screen may be.
const BARS_MAX: usize = 400;
const EVENTS_MAX: usize = 50;

/// What is new.
#[allow(clippy::large_enum_variant)] // one a message; none is kept
pub enum News {
    Skin(Skin),
    Force(Received),
    Taxels(TaxelSample),
    Event(Event),
    Health(Health),
    Said(String),
    Key(char),
}

/// All that is shown.
#[derive(Default)]
pub struct Top {
    pub colour: bool,
    pub patch: String,
    pub force: Option<Received>,
    /// The greatest force of each bar, in N, the newest last; NaN where there was none.
    pub course: VecDeque<f64>,
    /// When the newest bar began.
    pub began: Option<Moment>,
    /// Where each taxel lies on the flat skin.
    pub places: Vec<[f64; 2]>,
    pub taxels: Vec<TaxelReading>,
    pub health: Health,
    /// The newest last.
    pub events: VecDeque<Event>,
    /// The answer to the last key, or what is wrong with the connection.
    pub said: String,
}

impl Top {
    pub fn take(&mut self, news: News, now: Moment) {
        match news {
            News::Skin(skin) => {
                let [positions, normals] = skin.poses();
                self.places = flat(skin.taxels.len(), &positions, &normals);
                self.patch = skin.patch;
                self.events.clear(); // they come anew
                self.said.clear();
            }
            News::Force(force) => {
                self.bar(force.force(now, None).map_or(f64::NAN, |force| force.total_n), now);
                self.force = Some(force);
            }
            News::Taxels(sample) => self.taxels = sample.taxels,
            News::Event(event) => {
                self.events.push_back(event);
                self.events.drain(..self.events.len().saturating_sub(EVENTS_MAX));
            }
            News::Health(health) => self.health = health,
            News::Said(said) => self.said = said,
            News::Key('c') => self.said = "q ends this, then: taxeld calibrate".to_owned(),
            News::Key(_) => self.said.clear(),
        }
    }

    fn bar(&mut self, total_n: f64, now: Moment) {
        match self.course.back_mut() {
            Some(last) if self.began.is_some_and(|began| now.since(began) < BAR) => *last = last.max(total_n),
            _ => {
                self.began = Some(now);
                self.course.push_back(total_n);
                self.course.drain(..self.course.len().saturating_sub(BARS_MAX));
            }
        }
    }
}
