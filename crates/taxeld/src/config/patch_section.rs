//! `[[patch]]` of the file.

use std::path::PathBuf;

use serde::Deserialize;

/// `[[patch]]`
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatchSection {
    /// Its name in the service.
    pub name: String,
    /// The bus that its boards sit on.
    pub bus: String,
    /// Whether the daemon sends nothing to the boards.
    #[serde(default)]
    pub listen_only: bool,
    /// Period at which whole scans come, in ms: 1 to 209 for skin boards, to 5000 for other arrays.
    #[serde(default = "period_of_boards")]
    pub period_ms: u16,
    /// A module is stale after so many periods of silence.
    pub stale_periods: Option<u16>,
    /// The port of YARP that has the counts of its boards, on a bus whose source is `yarp`.
    pub port: Option<String>,
    /// A position file, relative to this one.
    pub geometry: Option<PathBuf>,
    /// Positions, areas and normals of a flat array.
    pub grid: Option<GridSection>,
    /// How the area of a module is shared out.
    #[serde(default)]
    pub area: AreaWord,
    /// Area per taxel; by default that of an iCub triangle, with the gaps beside it unless the areas are `equal`.
    pub area_mm2: Option<f64>,
    /// Relative standard uncertainty of the area; by default as little as is known of it.
    pub area_uncertainty: Option<f64>,
    /// What a force sample carries beside the total.
    #[serde(default)]
    pub outputs: Vec<OutputWord>,
    /// Skin boards, in the order of the taxels.
    #[serde(default)]
    pub boards: Vec<BoardSection>,
    /// Taxels of a sensor that is no skin board of iCub, by a DBC file.
    pub array: Option<ArraySection>,
    /// Taxels whose scans a program pushes.
    pub push: Option<PushSection>,
    /// The bag's pressure sensor.
    pub gauge: Option<GaugeSection>,
    /// Whether the zero is taken by itself after start, once the skin is seen to be unloaded.
    #[serde(default = "yes")]
    pub tare_at_start: bool,
    /// Whether the zero follows the temperature of the skin.
    #[serde(default)]
    pub follow_drift: bool,
    /// Rules of a session.
    #[serde(default)]
    pub session: SessionSection,
}

fn yes() -> bool {
    true
}

fn period_of_boards() -> u16 {
    50
}

/// `area`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AreaWord {
    /// The module's area is shared out as its taxels sample it, `area_mm2` in the mean of a module.
    #[default]
    Template,
    /// `area_mm2` for each, as in the paper.
    Equal,
}

/// A part of the force sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OutputWord {
    /// Force vector.
    Resultant,
    /// Moment and centre of pressure.
    Moment,
    /// Clusters of touched taxels.
    Contacts,
    /// Excluded taxels take the pressure of their neighbours.
    Fill,
}

/// One of `boards`. Entries of one address that follow each other are one board, whose modules are configured differently.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoardSection {
    /// CAN address, 1 to 15.
    pub address: u8,
    /// Enabled modules: `"0-15"`, `"0-3, 7"`, `"0-4 fingertip, 8-11 palm"`; of a board on a port also none: `""`.
    pub modules: String,
    /// Type in command 0x4D.
    #[serde(default)]
    pub board_type: u8,
    /// The count of an unloaded value, 240 unless it is set.
    pub no_load: Option<u8>,
    /// Right shift from converter units to counts, 2 unless it is set.
    pub shift: Option<u8>,
    /// Converter offset, 0x2200 unless it is set.
    pub cdc_offset: Option<u16>,
}

impl BoardSection {
    /// Whether it says how the board is to be configured.
    pub fn sets_something(&self) -> bool {
        self.board_type != 0 || self.no_load.is_some() || self.shift.is_some() || self.cdc_offset.is_some()
    }
}

/// `grid`
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridSection {
    /// Rows of taxels,
    pub rows: u16,
    /// columns, along which the taxels are numbered,
    pub columns: u16,
    /// and millimetres from one taxel to the next.
    pub pitch_mm: f64,
}

/// `[patch.array]`: signals are named `Message.Signal`, in which `*` stands for any letters.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArraySection {
    /// The DBC file, relative to this one.
    pub dbc: PathBuf,
    /// The taxels, in order.
    pub taxels: Vec<String>,
    /// Least and greatest number of a taxel that is used; by default all that its bits hold.
    pub numbers: Option<[i64; 2]>,
    /// A signal whose frame begins a scan. Without it and `counter` frames that are close in time belong together.
    pub sync: Option<String>,
    /// A signal in every frame, which counts scans.
    pub counter: Option<String>,
    /// A signal that tells a device's state, with the number for good, as in `Bag.State = 1`; without a number that is 0.
    pub status: Option<String>,
    /// Frames that make the device stream, as candump writes them: `(0.030) 123#01FF`.
    #[serde(default)]
    pub commands: Vec<String>,
}

/// `push`
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PushSection {
    /// How many taxels a scan has.
    pub taxels: u16,
    /// The greatest raw count of a taxel, 255 unless it is set; the least is 0.
    pub count_max: Option<u16>,
}

/// `gauge`
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GaugeSection {
    /// Its bus, if it is not the patch's.
    pub bus: Option<String>,
    /// Identifier of its frames; one of 29 bits that is below 0x800 has bit 31, as in DBC files.
    pub id: Option<u32>,
    /// With `id` its place in the frame, as a DBC file has it: `0|32@1-`, with factor and offset `7|16@0- (0.5,-1)`. Without,
    /// its name in the DBC file of the array. Neither where the pressure is pushed with the scans.
    pub signal: Option<String>,
    /// The port of YARP that has the pressure,
    pub port: Option<String>,
    /// and its place among the port's values, from 0.
    pub index: Option<usize>,
    /// Unit; by default that of the DBC file.
    pub unit: Option<String>,
    /// What has it: a serial device, with its rate after an `@` if that is not 115200, or `tcp:HOST:PORT`,
    pub line: Option<String>,
    /// what a line of text looks like that it prints, `P={kPa}`,
    pub template: Option<String>,
    /// the question that it answers with such a line; without one it prints by itself;
    pub poll: Option<String>,
    /// or its register of Modbus, `holding 18`.
    pub register: Option<String>,
    /// Whether a program pushes it over the service.
    pub push: bool,
    /// Whether it is a dial that an operator reads at each plateau,
    pub typed: bool,
    /// and to how many kPa.
    pub resolution_kpa: Option<f64>,
    /// What its readings refer to.
    pub reference: Option<ReferenceWord>,
    /// If the sensor reads the absolute bag pressure: the ambient pressure in kPa.
    pub ambient_kpa: Option<f64>,
    /// Relative standard uncertainty of its gain.
    pub gain_uncertainty: f64,
    /// Standard uncertainty of its zero in kPa.
    pub offset_uncertainty_kpa: f64,
    /// Standard deviation of one reading in kPa.
    pub noise_kpa: f64,
}

/// What a reading of a gauge refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceWord {
    /// It says how far the bag is below the ambient pressure.
    BelowAmbient,
    /// It says how far the bag is above it: less than 0 in vacuum.
    Ambient,
    /// It says the bag's own pressure.
    Absolute,
}

/// `[patch.session]`; absent keys keep the engine's defaults.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SessionSection {
    /// A ramp ends by itself here.
    pub target_kpa: Option<f64>,
    /// Whether the skin lies in a chamber under pressure, whose targets may lie above what a vacuum bag reaches.
    pub pressurised_chamber: bool,
    /// Which branches of the pressure a session gathers, unless it asks for others.
    pub branches: BranchesWord,
    /// A sample may lie so far behind the furthest pressure so far.
    pub noise_band_kpa: Option<f64>,
    /// Steepest rise and fall that enter.
    pub rise_max_kpa_per_s: Option<f64>,
}

/// Branches of the pressure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BranchesWord {
    /// Rising pressure alone.
    #[default]
    Rising,
    /// The fall after it too.
    Both,
}
