//! Folders in memory, samples, and processes that write and read pages.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use taxel_shm::{Folder, Limits, NoForce, Page, Sample, State, Text, now_ns};

/// Limits that a busy machine does not reach by itself; stamps of tests lie hours beyond them.
pub const LIMITS: Limits = Limits { age: Duration::from_secs(30), beat: Duration::from_secs(10) };

/// A folder on a tmpfs that goes with the test.
pub fn in_memory() -> tempfile::TempDir {
    tempfile::Builder::new().prefix("taxel-shm-test-").tempdir_in("/dev/shm").unwrap()
}

pub fn folder(place: &tempfile::TempDir) -> Folder {
    Folder::open(place.path(), None).unwrap()
}

pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A force of now, in which every part follows from the number.
pub fn good(sequence: u64) -> Sample {
    let n = sequence as f64;
    Sample {
        sequence,
        monotonic_ns: Some(now_ns()),
        wall_ns: -(sequence as i64),
        state: State::Ok,
        total_n: Some(n),
        sigma_n: Some(n + 0.25),
        low_n: Some(n - 0.5),
        high_n: Some(n + 0.75),
        undetected_n: Some(n + 0.5),
        step_n: Some(-n),
        zero_epoch: sequence + 1,
        resultant_n: Some([n + 1.0, n + 2.0, n + 3.0]),
        moment_nm: Some([n + 4.0, n + 5.0, n + 6.0]),
        centre_of_pressure_m: Some([n + 7.0, n + 8.0, n + 9.0]),
        active: sequence as u32 + 1,
        excluded: sequence as u32 + 2,
        stale: sequence as u32 + 3,
        out_of_range: sequence as u32 + 4,
        model_set: Text::new(&format!("m-{sequence}")),
        reasons: Text::new(&sequence.to_string()),
        ..Sample::default()
    }
}

/// Samples that differ in every way that a reader must tell apart.
pub fn cases() -> Vec<Sample> {
    let hour_ns = 3_600_000_000_000;
    let reasons = Text::new(&"\u{fc}ber alle Ma\u{df}en ".repeat(20));
    vec![
        good(4),
        Sample { state: State::Degraded, high_n: None, resultant_n: None, reasons, ..good(5) },
        Sample {
            simulated: true,
            sigma_n: None,
            undetected_n: None,
            step_n: None,
            moment_nm: None,
            centre_of_pressure_m: None,
            ..good(6)
        },
        Sample { state: State::TareInvalid, total_n: None, ..good(7) },
        Sample { state: State::Ok, total_n: Some(f64::NAN), ..good(8) },
        Sample { monotonic_ns: None, ..good(9) },
        Sample { monotonic_ns: Some(now_ns() - hour_ns), ..good(10) },
        Sample { monotonic_ns: Some(now_ns() + hour_ns), ..good(11) },
    ]
}

/// What a page says, in words that every language can print.
pub fn printed(page: &Page) -> String {
    let judged = page.force(None);
    let status = match judged {
        Ok(_) => 0,
        Err(NoForce::NoPage) => 1,
        Err(NoForce::NothingYet) => 2,
        Err(NoForce::Closed) => 3,
        Err(NoForce::WriterGone(_)) => 4,
        Err(NoForce::State(..)) => 5,
        Err(NoForce::TooOld(..)) => 6,
        Err(NoForce::OtherClock) => 7,
    };
    let s = page.newest().unwrap();
    let figures = |figures: Option<&[f64]>, count: usize| -> String {
        let shown = figures.filter(|_| judged.is_ok());
        (0..count).map(|i| shown.map_or(" -".to_owned(), |f| format!(" {:.3}", f[i]))).collect()
    };
    let one = |figure: &Option<f64>| figures(figure.as_ref().map(std::slice::from_ref), 1);
    let three = |vector: &Option<[f64; 3]>| figures(vector.as_ref().map(<[f64; 3]>::as_slice), 3);
    format!(
        "status {status}\nsequence {} stamps {} {} {}\nstate {} simulated {}\ntotal{}\nsigma{}\nlow{}\nhigh{}\nundetected{}\nstep{}\nepoch {}\n\
         resultant{}\nmoment{}\ncentre{}\ntaxels {} {} {} {}\nmodels {}\nreasons {}\n",
        s.sequence,
        s.monotonic_ns.unwrap_or_default(),
        s.wall_ns,
        s.written_ns,
        s.state as u32,
        u8::from(s.simulated),
        one(&s.total_n),
        one(&s.sigma_n),
        one(&s.low_n),
        one(&s.high_n),
        one(&s.undetected_n),
        one(&s.step_n),
        s.zero_epoch,
        three(&s.resultant_n),
        three(&s.moment_nm),
        three(&s.centre_of_pressure_m),
        s.active,
        s.excluded,
        s.stale,
        s.out_of_range,
        s.model_set,
        s.reasons,
    )
}

/// A process of this test's own binary that writes the page `palm` of a folder, and is killed at the end.
pub struct Child(std::process::Child);

impl Child {
    /// Starts it and waits until it is at work.
    pub fn start(folder: &Path) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["child", "--exact", "--ignored", "--nocapture"]).env("TAXEL_SHM_CHILD", folder);
        command.stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut until = lines.map_while(Result::ok).filter(|line| line.contains("at work"));
        assert!(until.next().is_some(), "the writer did not start");
        Self(child)
    }

    pub fn kill(&mut self) {
        let _ = self.0.kill(); // it may have ended
        self.0.wait().unwrap();
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.kill();
    }
}

/// What a child does, until it is killed.
pub fn child() {
    let Ok(folder) = std::env::var("TAXEL_SHM_CHILD") else { return };
    let mut writer = Folder::open(Path::new(&folder), None).unwrap().page("palm", short()).unwrap();
    let mut sequence = 1;
    writer.write(&good(sequence));
    println!("at work");
    loop {
        sequence += 1;
        writer.write(&good(sequence));
    }
}

/// Limits that a test can wait for.
fn short() -> Limits {
    Limits { age: Duration::from_secs(2), beat: Duration::from_secs(1) }
}

/// Reads `samples` samples in `readers` threads while another process writes without a pause. Panics at a torn one.
///
/// On a busy machine the writer may stand still for a while: a reader goes on until it has seen the writer at work.
pub fn stress(samples: u64, readers: u64) {
    let place = in_memory();
    let _writer = Child::start(place.path());
    std::thread::scope(|scope| {
        for _ in 0..readers {
            scope.spawn(|| {
                let page = Page::open(&place.path().join("palm")).unwrap();
                let (mut last, mut different) = (0, 0_u64);
                let (reads, least) = (samples / readers, samples / readers / 1_000);
                for read in 0..10_000 * reads {
                    if read >= reads && different > least {
                        break;
                    }
                    // None: the writer, which has no pause here, was faster than every try.
                    let Some(sample) = page.newest() else { continue };
                    whole(&sample);
                    assert!(sample.sequence >= last, "{} after {last}", sample.sequence);
                    different += u64::from(sample.sequence != last);
                    last = sample.sequence;
                }
                assert!(different > least, "only {different} different samples: the writer does not write");
            });
        }
    });
}

/// Panics if a sample is not one that was written.
fn whole(sample: &Sample) {
    let expected = good(sample.sequence);
    let expected = Sample { monotonic_ns: sample.monotonic_ns, written_ns: sample.written_ns, ..expected };
    assert_eq!(*sample, expected, "torn");
}
