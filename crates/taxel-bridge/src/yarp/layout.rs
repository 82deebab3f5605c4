//! Where the taxels of a patch stand in the vector of its skin port, and where they lie.

use taxel_proto::v1::{Skin, TaxelLayout, Vector3};
use taxel_skin::{VALUES_PER_BOARD, VALUES_PER_MODULE};

/// A taxel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taxel {
    /// Its row: in the vector of a skin port, and in a position file.
    pub row: usize,
    /// Its place in m.
    pub position: Option<[f64; 3]>,
    /// Its outward normal.
    pub normal: [f64; 3],
    /// Its area in mm2.
    pub area_mm2: f64,
}

/// All taxels of a patch, by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// In the order of the taxels' numbers.
    pub taxels: Vec<Taxel>,
    /// How many rows there are: 192 a board.
    pub rows: usize,
}

impl Layout {
    /// Of what the daemon says of the patch, whose boards are in the order of the port's vector.
    #[must_use]
    pub fn new(skin: &Skin) -> Self {
        let mut boards: Vec<_> = skin.taxels.iter().map(|taxel| (taxel.bus, taxel.board)).collect();
        boards.dedup();
        let rows = VALUES_PER_BOARD * boards.len();
        let board = |taxel: &TaxelLayout| boards.iter().position(|of| *of == (taxel.bus, taxel.board)).unwrap_or(0);
        let taxels = skin.taxels.iter().map(|taxel| Taxel {
            row: VALUES_PER_BOARD * board(taxel) + VALUES_PER_MODULE * taxel.module as usize + taxel.slot as usize,
            position: taxel.position_m.as_ref().map(array),
            normal: taxel.normal.as_ref().map(array).unwrap_or_default(),
            area_mm2: taxel.area_mm2,
        });
        Self { taxels: taxels.collect(), rows }
    }
}

/// As three numbers.
#[must_use]
pub fn array(vector: &Vector3) -> [f64; 3] {
    [vector.x, vector.y, vector.z]
}
