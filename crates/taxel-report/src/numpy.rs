//! numpy as a contender: one Python process that fits what it is given and times itself.

use anyhow::{Context as _, ensure};
use serde::Deserialize;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use crate::polynomial::{Basis, Fitted, Polynomial, Samples};

/// Reads `METHOD ORDER SAMPLES` and then x, y and the roots of the weights as f64; answers with one line of JSON. Each
/// fit runs twice and the second is timed, as it is for every contender.
const SCRIPT: &str = r#"
import json, os, sys, time, warnings
import numpy as np
warnings.simplefilter("ignore")
# LAPACK writes its complaints to the standard output, which is for answers alone.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
say = lambda answer: print(json.dumps(answer), file=answers, flush=True)
say({"python": sys.version.split()[0], "numpy": np.__version__})
def polyfit(x, y, order, w):
    return np.polyfit(x, y, order, w=w)[::-1], [-1.0, 1.0]
def polynomial(x, y, order, w):
    fitted = np.polynomial.Polynomial.fit(x, y, order, w=w)
    return fitted.coef, fitted.domain
while line := sys.stdin.buffer.readline().split():
    fit, order, samples = {b"polyfit": polyfit, b"polynomial": polynomial}[line[0]], int(line[1]), int(line[2])
    x, y, w = (np.frombuffer(sys.stdin.buffer.read(8 * samples), dtype="<f8").copy() for _ in range(3))
    w = None if np.all(w == 1.0) else w
    try:
        fit(x, y, order, w)
        start = time.perf_counter()
        coefficients, domain = fit(x, y, order, w)
        us = 1e6 * (time.perf_counter() - start)
        numbers = [float(c) if np.isfinite(c) else None for c in [*domain, *coefficients]]
        say({"us": us, "domain": numbers[:2], "coefficients": numbers[2:]})
    except Exception:
        say({"us": 0.0, "domain": [None, None], "coefficients": []})
"#;

/// What Python says of itself first.
#[derive(Deserialize)]
struct Versions {
    python: String,
    numpy: String,
}

/// An answer; `None` where a number is not finite.
#[derive(Deserialize)]
struct Answer {
    us: f64,
    /// The ends that the fit maps to -1 and 1.
    domain: [Option<f64>; 2],
    /// Ascending powers of that.
    coefficients: Vec<Option<f64>>,
}

/// The process. It ends when this is dropped, because its input ends.
pub(crate) struct Numpy {
    child: Child,
    /// Taken only at the end.
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    /// Of Python and numpy, in words.
    pub versions: String,
}

impl Numpy {
    /// Starts `python`.
    ///
    /// # Errors
    /// There is no such programme, or it has no numpy.
    pub fn start(python: &Path) -> anyhow::Result<Self> {
        let mut command = Command::new(python);
        // One thread, as for all contenders.
        command.envs(["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"].map(|variable| (variable, "1")));
        command.args(["-c", SCRIPT]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().with_context(|| format!("cannot start {}", python.display()))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let output = BufReader::new(output.context("no output of Python")?);
        let mut numpy = Self { child, input, output, versions: String::new() };
        let first = numpy.line().with_context(|| format!("{} has no numpy", python.display()))?;
        let versions: Versions = serde_json::from_str(&first).with_context(|| format!("unexpected line `{first}`"))?;
        numpy.versions = format!("numpy {} on Python {}", versions.numpy, versions.python);
        Ok(numpy)
    }

    /// Fits with `method` of the script.
    ///
    /// # Errors
    /// Python ended, or its answer is none.
    pub fn fit(&mut self, method: &str, samples: &Samples<'_>, order: usize) -> anyhow::Result<Fitted> {
        let input = self.input.as_mut().context("Python's input is closed")?;
        writeln!(input, "{method} {order} {}", samples.x.len())?;
        let roots = (0..samples.x.len()).map(|k| samples.root_of_weight(k));
        let all = samples.x.iter().chain(samples.y).copied().chain(roots);
        input.write_all(&all.flat_map(f64::to_le_bytes).collect::<Vec<u8>>())?;
        input.flush()?;
        let line = self.line()?;
        let answer: Answer = serde_json::from_str(&line).with_context(|| format!("unexpected answer `{line}`"))?;
        let curve = |[low, high]: [Option<f64>; 2], coefficients: Vec<Option<f64>>| {
            let (low, high) = (low?, high?);
            let (centre, half_width) = ((low + high) / 2.0, (high - low) / 2.0);
            let coefficients = coefficients.into_iter().collect::<Option<_>>()?;
            Some(Polynomial { basis: Basis::Powers, centre, half_width, coefficients })
        };
        Ok(Fitted { us: answer.us, curve: curve(answer.domain, answer.coefficients) })
    }

    fn line(&mut self) -> anyhow::Result<String> {
        let mut line = String::new();
        ensure!(self.output.read_line(&mut line)? > 0, "Python ended");
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
