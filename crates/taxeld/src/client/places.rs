//! Where taxels are, in the words of whoever stands at the robot: board, module, and the taxel's number in it.

use std::collections::BTreeMap;

use taxel_proto::v1::{Module, Skin, TaxelLayout};

/// Most places that one line names.
const PLACES_MAX: usize = 6;

/// The places of a patch's taxels.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// Board address and module by taxel.
    taxels: Vec<(u32, Module)>,
}

impl Places {
    /// Of the layout that the daemon tells.
    pub fn of(skin: &Skin) -> Self {
        let place = |layout: &TaxelLayout| {
            let board = skin.boards.get(layout.board as usize);
            let module = board.and_then(|b| b.modules.iter().find(|module| module.module == layout.module));
            (board.map_or(0, |board| board.address), module.copied().unwrap_or_default())
        };
        Self { taxels: skin.taxels.iter().map(place).collect() }
    }

    /// Names taxels by their place, whole modules as such: `board 12 module 3 (all 10); board 13 module 5: taxel 2, 7`.
    pub fn name(&self, taxels: impl IntoIterator<Item = u32>) -> String {
        let mut modules: BTreeMap<(u32, u32), (Module, Vec<u32>)> = BTreeMap::new();
        let mut elsewhere = Vec::new();
        for taxel in taxels {
            match self.taxels.get(taxel as usize) {
                Some((board, module)) => {
                    let (_, taxels) = modules.entry((*board, module.module)).or_insert((*module, Vec::new()));
                    taxels.push(taxel.saturating_sub(module.first_taxel));
                }
                None => elsewhere.push(taxel.to_string()),
            }
        }
        let named = modules.iter().take(PLACES_MAX).map(|((board, number), (module, taxels))| {
            if taxels.len() == module.taxels as usize {
                return format!("board {board} module {number} (all {})", module.taxels);
            }
            let numbers: Vec<String> = taxels.iter().map(ToString::to_string).collect();
            format!("board {board} module {number}: taxel {}", numbers.join(", "))
        });
        let mut words: Vec<String> = named.collect();
        if modules.len() > PLACES_MAX {
            words.push(format!("and {} modules more", modules.len() - PLACES_MAX));
        }
        if !elsewhere.is_empty() {
            words.push(format!("taxel {}", elsewhere.join(", ")));
        }
        words.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::v1::Board;

    #[test]
    fn taxels_are_named_by_board_module_and_number() {
        let module = |module, first_taxel| Module { module, first_taxel, taxels: 10, ..Module::default() };
        let boards = vec![
            Board { address: 13, modules: vec![module(0, 0)], ..Board::default() },
            Board { address: 12, modules: vec![module(4, 10)], ..Board::default() },
        ];
        let layout =
            |taxel: u32| TaxelLayout { taxel, board: taxel / 10, module: 4 * (taxel / 10), ..Default::default() };
        let skin = Skin { boards, taxels: (0..20).map(layout).collect(), ..Skin::default() };
        let places = Places::of(&skin);
        assert_eq!(places.name([]), "");
        assert_eq!(places.name([3, 7]), "board 13 module 0: taxel 3, 7");
        assert_eq!(places.name((10..20).chain([9])), "board 12 module 4 (all 10); board 13 module 0: taxel 9");
        assert_eq!(places.name([3, 77]), "board 13 module 0: taxel 3; taxel 77", "a taxel that the layout lacks");
    }
}
