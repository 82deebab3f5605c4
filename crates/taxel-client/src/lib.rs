//! The force on robot skin for controllers: connects to taxeld, keeps the newest sample alone, judges its age by the
//! receiver's own clock, and connects again by itself.
//!
//! ```no_run
//! use taxel_client::{Address, Options, blocking};
//!
//! let options = Options::new(Address::parse("unix:/run/taxeld/taxeld.sock")?);
//! let forces = blocking::follow(options)?;
//! loop {
//!     match forces.force() { // never waits
//!         Ok(force) => println!("{:.2} N, {:?} old", force.total_n, force.age),
//!         Err(why) => println!("no force: {why}"),
//!     }
//!     std::thread::sleep(std::time::Duration::from_millis(10));
//! }
//! # #[allow(unreachable_code)]
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Principles:
//! 1. The control loop never waits and never works through a queue: a task of its own takes samples off the stream at
//!    once, and small HTTP/2 windows leave what is not read at the daemon, which replaces it.
//! 2. Only OK and DEGRADED are forces, and only while they are younger than the limit.
//! 3. An age is never stated too small, also of a sample that waited somewhere on its way: the wall clocks of daemon and
//!    reader say for how long. Another machine than the daemon's needs NTP or PTP; without it, forces are refused as too old
//!    where the reader's clock is ahead.
//! 4. A connection that is lost is made again, with pauses that grow up to two seconds; until then the force grows old.

pub mod blocking;
mod connect;
mod follow;
mod health;
mod moment;
mod received;
#[cfg(feature = "clap")]
mod server;
mod stream;

#[cfg(feature = "tls")]
pub use connect::TlsOptions;
pub use connect::{Address, BadAddress, ConnectError, Credential, Line, Options, root_cause};
pub use follow::{Forces, follow};
pub use health::troubles;
pub use moment::Moment;
pub use received::{Force, NoForce, Received};
#[cfg(feature = "clap")]
pub use server::{Server, model_set_named};
pub use stream::Samples;
