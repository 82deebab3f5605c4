//! What a daemon's health comes to.

use taxel_proto::v1::Health;

/// What keeps the force from being good, in words.
#[must_use]
pub fn troubles(health: &Health) -> Vec<String> {
    let mut wrong = health.problems.clone();
    let down = health.buses.iter().filter(|bus| !bus.up);
    wrong.extend(down.map(|bus| format!("bus {} is down: {}", bus.bus, bus.problem)));
    let silent = health.boards.iter().filter(|board| board.modules_fresh < board.modules_enabled);
    wrong.extend(silent.map(|b| {
        let missing = b.modules_enabled - b.modules_fresh;
        format!("board {}: {missing} of {} modules are silent", b.address, b.modules_enabled)
    }));
    for patch in &health.patches {
        match &patch.tare {
            Some(tare) if !tare.valid => wrong.push(format!("{}: the zero is invalid: {}", tare.patch, tare.reason)),
            _ if !patch.no_force.is_empty() => wrong.push(format!("{}: no force: {}", patch.patch, patch.no_force)),
            _ => {}
        }
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_proto::v1::{BoardHealth, BusHealth, PatchHealth, TareStatus};

    #[test]
    fn what_is_not_well_is_named_and_nothing_else() {
        let good = Health {
            buses: vec![BusHealth { up: true, ..Default::default() }],
            boards: vec![BoardHealth { modules_enabled: 3, modules_fresh: 3, ..Default::default() }],
            patches: vec![PatchHealth {
                tare: Some(TareStatus { valid: true, ..Default::default() }),
                ..Default::default()
            }],
            ..Health::default()
        };
        assert!(troubles(&good).is_empty());
        let mut bad = good;
        bad.buses[0].up = false;
        bad.boards[0].modules_fresh = 1;
        bad.patches[0].tare.as_mut().unwrap().valid = false;
        bad.problems.push("store: full".to_owned());
        let said = troubles(&bad).join("\n");
        for part in ["store: full", "bus 0 is down", "2 of 3 modules are silent", "the zero is invalid"] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
}
