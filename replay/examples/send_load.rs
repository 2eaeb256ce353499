//! Sends numbered messages over LCM at a constant rate: `send_load URL RATE_HZ BYTES SECONDS`. Used by `scripts/record_load.sh`.
#![allow(clippy::unwrap_used)]

use lcmtypes::bus::{Bus, LcmBus};
use std::time::{Duration, Instant};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [url, rate, bytes, seconds] = &arguments[..] else { panic!("send_load URL RATE_HZ BYTES SECONDS") };
    let (rate, bytes, seconds): (u32, usize, f64) =
        (rate.parse().unwrap(), bytes.parse().unwrap(), seconds.parse().unwrap());
    let mut bus = LcmBus::open(url).unwrap();
    let period = Duration::from_secs(1) / rate;
    let began = Instant::now();
    let (mut sent, mut data) = (0u64, vec![0x5a; bytes.max(8)]);
    let mut late = Duration::ZERO;
    while began.elapsed().as_secs_f64() < seconds {
        // Publish every message that is due; the sleep in between leaves the core to receivers.
        while began.elapsed() >= period.mul_f64(sent as f64) && began.elapsed().as_secs_f64() < seconds {
            late = late.max(began.elapsed() - period.mul_f64(sent as f64));
            data[..8].copy_from_slice(&sent.to_be_bytes());
            bus.publish("LOAD", &data).unwrap();
            sent += 1;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    println!(
        "sent {sent} in {:.2} s, at most {:.1} ms behind",
        began.elapsed().as_secs_f64(),
        late.as_secs_f64() * 1e3
    );
}
