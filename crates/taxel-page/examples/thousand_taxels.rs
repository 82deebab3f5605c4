//! A made-up skin of a thousand taxels that all change a hundred times a second, behind a page on the address given. It
//! shows what the page costs: `cargo run --release -p taxel-page --example thousand_taxels -- 127.0.0.1:8090`, then
//! `tests/page/frames.py`.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use taxel_engine::plan::{PatchPlan, Plan};
use taxel_engine::snapshot::{ForceSample, ForceState, PatchSnapshot, TaxelState};
use taxel_page::{Limits, Options, bind, serve};
use taxel_rpc::handle::channel;
use taxel_rpc::{Access, Backend, Clock, Publisher, Rules, Server};
use taxel_skin::{Board, BoardAddress, BusIndex, Geometry, Module, ModuleKind, Newton, Patch, TaxelPose, Time};
use tokio_util::sync::CancellationToken;

const BOARDS: u8 = 7;
const RATE: Duration = Duration::from_millis(10);
const RADIUS_M: f64 = 0.06;

/// A daemon without a store.
struct NoStore;

impl Backend for NoStore {}

/// Triangles around a cylinder, 16 to the turn.
fn plan() -> Result<Plan, Box<dyn std::error::Error>> {
    let board = |address| -> Result<Board, Box<dyn std::error::Error>> {
        let modules = (0..16).map(|m| (Module::from_nibble(m), ModuleKind::Triangle)).collect();
        Ok(Board { bus: BusIndex(0), address: BoardAddress::new(address)?, modules })
    };
    let boards = (1..=BOARDS).map(board).collect::<Result<_, _>>()?;
    let patch = Patch::new("thousand", boards)?;
    let pose = |taxel: usize| {
        let (module, place) = (taxel / 10, taxel % 10);
        let angle = (module % 16) as f64 * 0.38 + (place % 4) as f64 * 0.1;
        let along = (module / 16) as f64 * 0.025 + (place / 4) as f64 * 0.0055;
        let normal = [0.0, angle.cos(), angle.sin()];
        Some(TaxelPose { position: [along, RADIUS_M * normal[1], RADIUS_M * normal[2]], normal })
    };
    let poses = (0..patch.taxels().len()).map(pose).collect();
    let geometry = Some(Geometry::from_poses(poses));
    Ok(Plan { buses: 1, patches: vec![PatchPlan { geometry, ..PatchPlan::new(patch) }] })
}

async fn publish(engine: Publisher, clock: Clock, taxels: usize) {
    let mut ticks = tokio::time::interval(RATE);
    for sequence in 1.. {
        ticks.tick().await;
        let time = clock();
        let reading = |taxel: usize| {
            let wave = (sequence as f32 / 40.0 + taxel as f32 / 30.0).sin().max(0.0);
            let count = 230 - (90.0 * wave) as u8;
            let (pressure_kpa, sigma_kpa) = (Some(30.0 * wave), Some(0.5 + wave));
            let active = wave > 0.1;
            let seen = TaxelState {
                count: u16::from(count),
                time,
                seen: true,
                calibrated: true,
                active,
                ..TaxelState::default()
            };
            TaxelState { pressure_kpa, sigma_kpa, ..seen }
        };
        let total = Some(Newton(200.0));
        let force =
            ForceSample { state: ForceState::Ok, total, total_sigma: Some(Newton(5.0)), ..ForceSample::default() };
        let taxels = (0..taxels).map(reading).collect::<Vec<_>>().into();
        let snapshot = PatchSnapshot { sequence, time, seen: true, force, taxels, ..PatchSnapshot::default() };
        let _ = engine.beat(); // how long it had no turn concerns an engine alone
        engine.patch(0, Arc::new(snapshot));
    }
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address: SocketAddr = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:8090".to_owned()).parse()?;
    let begun = Instant::now();
    let clock: Clock = Arc::new(move || Time::from_nanos(begun.elapsed().as_nanos() as i64));
    let plan = Arc::new(plan()?);
    let taxels = plan.patches[0].patch.taxels().len();
    let shutdown = CancellationToken::new();
    let (handle, engine, _requests) = channel(plan, Arc::clone(&clock), shutdown.clone());
    let server =
        Server::new(handle.clone(), Arc::new(NoStore), Access::new(Rules::open()), taxel_rpc::Limits::default())?;
    let services = server.shared();
    tokio::spawn(server.serve(Vec::new()));
    tokio::spawn(publish(engine, clock, taxels));
    let listener = bind(address)?;
    let options = Options { services, handle, names: Vec::new(), limits: Limits::default() };
    println!("{taxels} taxels on http://{}/", listener.local_addr()?);
    Ok(serve(listener, options, shutdown).await?)
}
