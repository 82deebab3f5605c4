//! A robot controller that reads the force of the skin: the newest sample, only if it is good and fresh.
//!
//! `cargo run --release -p taxel-client --example controller -- [127.0.0.1:50051 [PATCH]]`

use std::time::Duration;

use taxel_client::{Address, Options, blocking};

/// The control loop's own period.
const LOOP: Duration = Duration::from_millis(10);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let address = arguments.next().map_or_else(|| Ok(Address::local()), |text| Address::parse(&text))?;
    let patch = arguments.next().unwrap_or_default();
    let forces = blocking::follow(Options { patch, rate_hz: Some(200.0), ..Options::new(address) })?;
    for cycle in 0_u64.. {
        std::thread::sleep(LOOP);
        let force = forces.force();
        // Here the controller acts. This one shows what it has, twice a second.
        if cycle.is_multiple_of(50) {
            match force {
                Ok(force) => println!("{:6.2} N, {:3.0} ms old", force.total_n, force.age.as_secs_f64() * 1e3),
                Err(why) => println!("no force: {why}"),
            }
        }
    }
    Ok(())
}
