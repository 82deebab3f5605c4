//! What each key expects, for whoever wrote something else.

use taxel_wire::signal::PressureUnit;

/// Keys and what they expect. Sections of lists have no numbers here. The ranges are those that `resolve` checks.
const EXPECTED: [(&str, &str); 63] = [
    ("store.path", "the path of a file, as in \"/var/lib/taxeld/taxeld.db\""),
    ("store.budget_mb", "a whole number of megabytes"),
    ("store.keep_model_sets", "a whole number of model sets"),
    ("store.keep_sessions", "a whole number of sessions"),
    ("store.keep_samples", "a whole number of samples"),
    ("store.keep_mb", "a whole number of megabytes"),
    ("service.listen", "an address and a port, as in \"127.0.0.1:50051\""),
    ("service.subscribers_max", "a whole number of streams"),
    ("service.subscribers_per_peer_max", "a whole number of streams"),
    ("service.connections_max", "a whole number of connections"),
    ("page.listen", "an address and a port, as in \"127.0.0.1:8080\""),
    ("metrics.listen", "an address and a port, as in \"127.0.0.1:9464\""),
    ("listen.tcp", "an address and a port, as in \"0.0.0.0:50052\""),
    ("listen.mode", "a mode of a file, as in 0o660"),
    ("log.filter", "a level or targets with levels, as in \"warn\" or \"taxel_rpc=debug,info\""),
    ("bus.name", "a text, the name by which patches call it"),
    ("bus.source", "\"socketcan\" or \"sim\""),
    ("bus.interface", "the name of a network interface, as in \"can0\""),
    ("bus.seed", "a whole number"),
    ("patch.name", "1 to 64 letters, digits, `_` or `-`"),
    ("patch.bus", "the name of a [[bus]]"),
    ("patch.listen_only", "true or false"),
    ("patch.period_ms", "a whole number of milliseconds from 1 to 209, for an array without boards to 5000"),
    ("patch.geometry", "the path of a position file"),
    ("patch.area", "\"template\", \"equal\" or \"voronoi\""),
    ("patch.area_factor", "\"off\" or \"from-loads\""),
    ("patch.area_mm2", "a number of mm2 from 0.01 to 100000"),
    ("patch.area_uncertainty", "a number from 0 to 1"),
    ("patch.outputs", "a list of \"resultant\", \"moment\", \"contacts\" and \"fill\""),
    ("patch.board.address", "a whole number from 1 to 15"),
    ("patch.board.modules", "a text as in \"0-15\" or \"0-3, 7\""),
    ("patch.board.board_type", "a whole number from 0 to 255"),
    ("patch.board.no_load", "a whole number from 0 to 255"),
    ("patch.board.shift", "a whole number from 0 to 255"),
    ("patch.board.cdc_offset", "a whole number from 0 to 65535"),
    ("patch.gauge.id", "a whole number, as in 0x3A1"),
    ("patch.gauge.extended", "true or false"),
    ("patch.gauge.start_bit", "a whole number, as in DBC files"),
    ("patch.gauge.length_bits", "a whole number of bits"),
    ("patch.gauge.byte_order", "\"little\" or \"big\""),
    ("patch.gauge.signed", "true or false"),
    ("patch.gauge.unit", PressureUnit::NAMES),
    ("patch.array.gauge_is.unit", PressureUnit::NAMES),
    ("patch.gauge.ambient_kpa", "a number of kPa"),
    ("patch.gauge.gain_uncertainty", "a number from 0 to 1"),
    ("patch.gauge.offset_uncertainty_kpa", "a number of kPa from 0 to 100"),
    ("patch.gauge.noise_kpa", "a number of kPa from 0 to 100"),
    ("patch.live.stale_periods", "a whole number from 2 to 100"),
    ("patch.tare.seconds", "a number of seconds from 0.1 to 60"),
    ("patch.tare.at_start", "true or false"),
    ("patch.drift.follow", "true or false"),
    ("patch.session.target_kpa", "a number of kPa from 1 to 95, or with pressurised_chamber = true to 1000"),
    ("patch.session.pressurised_chamber", "true or false"),
    ("patch.session.branches", "\"rising\" or \"both\""),
    ("patch.session.rise_max_kpa_per_s", "a number of kPa/s from 0.1 to 1000"),
    ("patch.session.fall_max_kpa_per_s", "a number of kPa/s from 0.1 to 1000"),
    ("patch.session.fall_end_kpa", "a number of kPa from 0 to 1000"),
    ("patch.session.vented_below_kpa", "a number of kPa from 0.1 to 1000"),
    ("patch.fit.order", "a whole number from 1 to 10, or \"auto\""),
    ("patch.fit.estimator", "\"pressure-binned\", \"per-sample\" or \"paper\""),
    ("patch.fit.exact", "true or false"),
    ("patch.fit.plays", "\"auto\", \"on\" or \"off\""),
    ("patch.fit.min_swing_counts", "a number of counts from 0 to 255"),
];

/// What the key at this path, without numbers of elements, expects.
pub fn expected(key: &str) -> Option<&'static str> {
    EXPECTED.iter().find(|(known, _)| *known == key).map(|(_, expected)| *expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A key that was renamed would have no words any more.
    #[test]
    fn every_key_here_exists() {
        for (key, _) in EXPECTED {
            let (section, name) = key.rsplit_once('.').unwrap();
            let header = match section {
                "bus" | "patch" | "listen" => format!("[[{section}]]"),
                "patch.board" => "[[patch]]\n[[patch.board]]".to_owned(),
                _ if section.starts_with("patch.") => format!("[[patch]]\n[{section}]"),
                _ => format!("[{section}]"),
            };
            let tried = toml::from_str::<crate::config::Config>(&format!("{header}\n{name} = {{}}\n"));
            let error = tried.unwrap_err();
            assert!(!error.message().contains("unknown"), "{key}: {error}");
        }
    }
}
