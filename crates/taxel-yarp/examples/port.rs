//! Writes a port for a while: `port SERVER /name:o [SECONDS]`. To look at what YARP's own programs make of it.

use std::time::{Duration, SystemTime};

use taxel_yarp::{NameServer, OutPort, Value};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let server = NameServer::at(&arguments.next().ok_or("which name server?")?)?;
    let name = arguments.next().ok_or("which name?")?;
    let seconds: u64 = arguments.next().map_or(Ok(60), |seconds| seconds.parse())?;
    let mut port = OutPort::open(&server, &name).await?;
    for count in 0..seconds * 50 {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH)?.as_secs_f64();
        let contact =
            Value::List(vec![Value::floats([f64::NAN, 0.5]), Value::List(vec![Value::Int(47)]), Value::Float(9.3)]);
        port.send(now, &[Value::Int(count as i64), Value::Float(1.0), Value::Text("no frame".into()), contact]);
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    Ok(port.close().await?)
}
