//! Taxels by their number in the patch, with the board and module that each is on.

use std::collections::BTreeMap;

use taxel_proto::v1::Skin;
use taxel_skin::counted;

/// Most places that one line names.
const PLACES_MAX: usize = 6;

/// A module by its bus, its board's address and its own number.
type Module = (u32, u32, u32);

/// The places of a patch's taxels.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// The module of each taxel.
    taxels: Vec<Module>,
    /// How many taxels each module has.
    modules: BTreeMap<Module, usize>,
}

impl Places {
    /// Of the layout that the daemon tells.
    pub fn of(skin: &Skin) -> Self {
        let taxels: Vec<Module> = skin.taxels.iter().map(|layout| (layout.bus, layout.board, layout.module)).collect();
        let mut modules = BTreeMap::new();
        taxels.iter().for_each(|module| *modules.entry(*module).or_default() += 1);
        Self { taxels, modules }
    }

    /// Names taxels by their place, whole modules as such: `board 12 module 3 (all 10); board 13 module 5: taxel 52, 57`.
    pub fn name(&self, taxels: impl IntoIterator<Item = u32>) -> String {
        let (mut modules, mut elsewhere): (BTreeMap<Module, Vec<u32>>, _) = (BTreeMap::new(), Vec::new());
        for taxel in taxels {
            match self.taxels.get(taxel as usize) {
                Some(module) => modules.entry(*module).or_default().push(taxel),
                None => elsewhere.push(taxel.to_string()),
            }
        }
        let named = modules.iter().take(PLACES_MAX).map(|(module, taxels)| {
            let ((_, board, number), all) = (module, self.modules.get(module).copied().unwrap_or_default());
            if taxels.len() == all {
                return format!("board {board} module {number} (all {all})");
            }
            let numbers: Vec<String> = taxels.iter().map(ToString::to_string).collect();
            format!("board {board} module {number}: taxel {}", numbers.join(", "))
        });
        let mut words: Vec<String> = named.collect();
        if modules.len() > PLACES_MAX {
            words.push(format!("and {} more", counted(modules.len() - PLACES_MAX, "module", "modules")));
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
    use taxel_proto::v1::TaxelLayout;

    #[test]
    fn taxels_have_their_number_in_the_patch_beside_board_and_module() {
        let layout =
            |taxel: u32| TaxelLayout { taxel, board: 13 - taxel / 10, module: 4 * (taxel / 10), ..Default::default() };
        let places = Places::of(&Skin { taxels: (0..20).map(layout).collect(), ..Skin::default() });
        assert_eq!(places.name([]), "");
        assert_eq!(places.name([3, 7]), "board 13 module 0: taxel 3, 7");
        assert_eq!(places.name((10..20).chain([9])), "board 12 module 4 (all 10); board 13 module 0: taxel 9");
        assert_eq!(places.name([12, 17]), "board 12 module 4: taxel 12, 17");
        assert_eq!(places.name([3, 77]), "board 13 module 0: taxel 3; taxel 77", "a taxel that the layout lacks");
    }
}
