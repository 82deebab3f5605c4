//! A controller that reads the force from shared memory a thousand times a second.
//!
//! `cargo run --release -p taxel-shm --example controller -- [/dev/shm/taxeld/PATCH]`

use std::time::Duration;

use taxel_shm::Reader;

fn main() {
    let page = std::env::args().nth(1).unwrap_or_else(|| "/dev/shm/taxeld/left_forearm".to_owned());
    let mut reader = Reader::new(page, None);
    for cycle in 0_u64.. {
        std::thread::sleep(Duration::from_millis(1));
        let force = reader.force();
        // Here the controller acts. This one shows what it has, twice a second.
        if cycle.is_multiple_of(500) {
            match force {
                Ok(force) => println!("{:6.2} N, {:3.0} ms old", force.total_n, force.age.as_secs_f64() * 1e3),
                Err(why) => println!("no force: {why}"),
            }
        }
    }
}
