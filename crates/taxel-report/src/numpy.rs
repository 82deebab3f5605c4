//! numpy.polyfit as a contender: one Python process that keeps the data, fits when asked, and times itself.
//!
//! Asked fit by fit, so that it takes its turn among the other contenders. It runs on one thread, as they do.

use anyhow::{Context as _, bail, ensure};
use serde::Deserialize;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Reads `load TAXELS SCANS` with the pressures and then every taxel's counts as f64, `fit TAXEL ORDER` and
/// `loop ORDER`; answers each with one line of JSON.
const SCRIPT: &str = r#"
import json, sys, time, warnings
import numpy as np
warnings.simplefilter("ignore")
clock, source = time.perf_counter, sys.stdin.buffer
say = lambda answer: print(json.dumps(answer), flush=True)
say({"python": sys.version.split()[0], "numpy": np.__version__})
while line := source.readline().split():
    if line[0] == b"load":
        taxels, scans = int(line[1]), int(line[2])
        read = lambda: np.frombuffer(source.read(8 * scans), dtype="<f8").copy()
        pressure, counts = read(), [read() for _ in range(taxels)]
        say({"us": 0.0, "coefficients": []})
    elif line[0] == b"fit":
        x, order = counts[int(line[1])], int(line[2])
        try:
            start = clock()
            fitted = np.polyfit(x, pressure, order)
            us = 1e6 * (clock() - start)
            fitted = [c if np.isfinite(c) else None for c in fitted[::-1].tolist()]
            say({"us": us, "coefficients": fitted})
        except np.linalg.LinAlgError:
            say({"us": 0.0, "coefficients": [None]})
    elif line[0] == b"loop":
        order = int(line[1])
        start = clock()
        for x in counts:
            np.polyfit(x, pressure, order)
        say({"us": 1e6 * (clock() - start), "coefficients": []})
"#;

/// What Python says of itself first.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Versions {
    /// Of Python.
    pub python: String,
    /// Of numpy.
    pub numpy: String,
}

/// An answer to `fit` or `loop`.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Fitted {
    /// Time by Python's own clock, us.
    pub us: f64,
    /// Ascending powers of the raw abscissa; `None` where not finite.
    coefficients: Vec<Option<f64>>,
}

impl Fitted {
    /// The coefficients, if numpy found finite ones.
    pub fn coefficients(&self) -> Option<Vec<f64>> {
        self.coefficients.iter().copied().collect()
    }
}

/// The process. It ends when this is dropped, because its input ends.
#[derive(Debug)]
pub(crate) struct Numpy {
    child: Child,
    /// Taken only at the end.
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    versions: Versions,
}

impl Numpy {
    /// Starts `python`.
    ///
    /// # Errors
    /// There is no such programme, or it has no numpy.
    pub fn start(python: &Path) -> anyhow::Result<Self> {
        let mut command = Command::new(python);
        // One thread, as for all contenders.
        for variable in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"] {
            command.env(variable, "1");
        }
        command.args(["-c", SCRIPT]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().with_context(|| format!("cannot start {}", python.display()))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let output = BufReader::new(output.context("no output of Python")?);
        let versions = Versions { python: String::new(), numpy: String::new() };
        let mut numpy = Self { child, input, output, versions };
        let first = numpy.line().with_context(|| format!("{} has no numpy", python.display()))?;
        numpy.versions = serde_json::from_str(&first).with_context(|| format!("unexpected first line `{first}`"))?;
        Ok(numpy)
    }

    /// Of Python and numpy.
    pub fn versions(&self) -> &Versions {
        &self.versions
    }

    /// Hands over pressures and the counts of every taxel, all of the same length.
    pub fn load(&mut self, pressure: &[f64], counts: &[&[f64]]) -> anyhow::Result<()> {
        ensure!(counts.iter().all(|counts| counts.len() == pressure.len()), "counts and pressures differ in length");
        let input = self.input.as_mut().context("Python's input is closed")?;
        writeln!(input, "load {} {}", counts.len(), pressure.len())?;
        for values in std::iter::once(pressure).chain(counts.iter().copied()) {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            input.write_all(&bytes)?;
        }
        input.flush()?;
        self.answer().map(drop)
    }

    /// Fits one taxel of the data loaded last.
    pub fn fit(&mut self, taxel: usize, order: usize) -> anyhow::Result<Fitted> {
        self.ask(&format!("fit {taxel} {order}"))
    }

    /// Fits all taxels of the data loaded last in a loop.
    pub fn fit_all(&mut self, order: usize) -> anyhow::Result<Fitted> {
        self.ask(&format!("loop {order}"))
    }

    fn ask(&mut self, request: &str) -> anyhow::Result<Fitted> {
        let input = self.input.as_mut().context("Python's input is closed")?;
        writeln!(input, "{request}").and_then(|()| input.flush()).with_context(|| format!("cannot ask `{request}`"))?;
        self.answer().with_context(|| format!("no answer to `{request}`"))
    }

    fn answer(&mut self) -> anyhow::Result<Fitted> {
        let line = self.line()?;
        serde_json::from_str(&line).with_context(|| format!("unexpected answer `{line}` of numpy"))
    }

    fn line(&mut self) -> anyhow::Result<String> {
        let mut line = String::new();
        if self.output.read_line(&mut line)? == 0 {
            bail!("Python ended");
        }
        Ok(line)
    }
}

impl Drop for Numpy {
    fn drop(&mut self) {
        drop(self.input.take());
        // It has read its last line; nothing is left to say if that fails.
        let _ = self.child.wait();
    }
}
