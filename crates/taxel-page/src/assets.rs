//! The page's own files, compiled in. There is nothing else to be had by a path.

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";

macro_rules! files {
    ($($kind:ident: $($file:literal)*;)*) => {
        &[("/", HTML, include_bytes!("../web/index.html")),
            $($((concat!("/", $file), $kind, include_bytes!(concat!("../web/", $file))),)*)*]
    };
}

/// Path, content type, content.
pub(crate) const FILES: &[(&str, &str, &[u8])] = files! {
    CSS: "page.css";
    SVG: "icon.svg";
    SCRIPT: "main.js" "api.js" "dom.js" "clock.js" "judge.js" "store.js" "unroll.js" "skin.js" "solid.js" "chart.js" "ticks.js"
        "taxel.js" "live.js" "calibrate.js" "validate.js" "models.js" "sessions.js" "health.js";
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_page_is_compiled_in() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/web");
        for file in std::fs::read_dir(folder).unwrap() {
            let name = file.unwrap().file_name().into_string().unwrap();
            let path = if name == "index.html" { "/".to_owned() } else { format!("/{name}") };
            assert!(FILES.iter().any(|(known, ..)| *known == path), "{name}");
        }
    }
}
