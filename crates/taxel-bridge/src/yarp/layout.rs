//! Where the taxels of a patch stand in the vector of its skin port, and where they lie.

use taxel_proto::v1::{Skin, TaxelLayout, Vector3};
use taxel_skin::{VALUES_PER_BOARD, VALUES_PER_MODULE};

/// All taxels of a patch, by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layout {
    /// What the daemon says of each, and its row: in the vector of a skin port, and in a position file.
    pub taxels: Vec<(usize, TaxelLayout)>,
    /// How many rows there are: 192 a board.
    pub rows: usize,
}

impl Layout {
    /// Of what the daemon says of the patch, whose boards are in the order of the port's vector.
    pub fn new(skin: &Skin) -> Self {
        let mut boards: Vec<_> = skin.taxels.iter().map(|taxel| (taxel.bus, taxel.board)).collect();
        boards.dedup();
        let row = |taxel: &TaxelLayout| {
            let board = boards.iter().position(|of| *of == (taxel.bus, taxel.board)).unwrap_or(0);
            VALUES_PER_BOARD * board + VALUES_PER_MODULE * taxel.module as usize + taxel.slot as usize
        };
        let taxels = skin.taxels.iter().map(|taxel| (row(taxel), taxel.clone())).collect();
        Self { taxels, rows: VALUES_PER_BOARD * boards.len() }
    }
}

/// As three numbers.
pub fn array(vector: &Option<Vector3>) -> [f64; 3] {
    vector.as_ref().map(|vector| [vector.x, vector.y, vector.z]).unwrap_or_default()
}
