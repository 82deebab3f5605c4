//! The page's own files, compiled in. There is nothing else to be had by a path.

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const SVG: &str = "image/svg+xml";

macro_rules! files {
    ($($path:literal, $file:literal, $kind:expr;)*) => {
        &[$(($path, $kind, include_bytes!(concat!("../web/", $file)))),*]
    };
}

/// Path, content type, content.
pub(crate) const FILES: &[(&str, &str, &[u8])] = files! {
    "/", "index.html", HTML;
    "/page.css", "page.css", CSS;
    "/icon.svg", "icon.svg", SVG;
    "/main.js", "main.js", SCRIPT;
    "/api.js", "api.js", SCRIPT;
    "/dom.js", "dom.js", SCRIPT;
    "/clock.js", "clock.js", SCRIPT;
    "/judge.js", "judge.js", SCRIPT;
    "/store.js", "store.js", SCRIPT;
    "/unroll.js", "unroll.js", SCRIPT;
    "/skin.js", "skin.js", SCRIPT;
    "/solid.js", "solid.js", SCRIPT;
    "/chart.js", "chart.js", SCRIPT;
    "/ticks.js", "ticks.js", SCRIPT;
    "/taxel.js", "taxel.js", SCRIPT;
    "/live.js", "live.js", SCRIPT;
    "/calibrate.js", "calibrate.js", SCRIPT;
    "/validate.js", "validate.js", SCRIPT;
    "/models.js", "models.js", SCRIPT;
    "/sessions.js", "sessions.js", SCRIPT;
    "/health.js", "health.js", SCRIPT;
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

    #[test]
    fn no_file_of_the_page_names_a_place_elsewhere() {
        for (path, _, content) in FILES {
            let text = String::from_utf8(content.to_vec()).unwrap();
            let text = text.replace("http://www.w3.org/2000/svg", "");
            assert!(!text.contains("://") && !text.contains("src=\"//"), "{path}");
        }
    }
}
