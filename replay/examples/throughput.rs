//! Benchmark of reading and converting logs, beside liblcm, the mcap crate, and zstd alone; on the same files in one process, best of
//! several rounds.
//!
//! ```sh
//! cargo run --release -p replay --example throughput [MILLIONS OF EVENTS]
//! ```
//! Needs a C compiler and liblcm-dev, as the tests do.

use replay::log::{CopyOptions, ItemRef, LogReader, LogWriter, copy};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Bytes of a message.
const MESSAGE: usize = 500;
const ROUNDS: usize = 3;

type Any<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Any<()> {
    let millions: f64 = std::env::args().nth(1).map_or(Ok(0.5), |text| text.parse())?;
    let events = (millions * 1e6) as u64;
    let folder = std::env::temp_dir().join(format!("hoofprint_throughput_{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let result = run(&folder, events);
    std::fs::remove_dir_all(&folder)?;
    result
}

fn run(folder: &Path, events: u64) -> Any<()> {
    let (log, mcap, out) = (folder.join("log.lcmlog"), folder.join("log.mcap"), folder.join("out.mcap"));
    let stock = folder.join("stock_reader");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/stock_reader.c");
    let status = Command::new("cc").arg("-O2").arg("-o").arg(&stock).arg(source).arg("-llcm").status()?;
    if !status.success() {
        return Err("cc: cannot build examples/stock_reader.c".into());
    }
    write(&log, events)?;
    write(&mcap, events)?;

    let mut best = [f64::INFINITY; 7];
    let mut take = |place: usize, seconds: f64| best[place] = best[place].min(seconds);
    for _ in 0..ROUNDS {
        take(0, stock_reads(&stock, &log, events)?);
        take(1, timed(|| scan(&log))?);
        take(2, timed(|| Ok(LogReader::open(&log)?.events().count() as u64))?);
        take(3, timed(|| mcap_crate(&mcap))?);
        take(4, timed(|| scan(&mcap))?);
        take(5, timed(|| Ok(copy(&log, &out, CopyOptions::default(), &mut |_| ())?.events))?);
        take(6, timed(|| zstd_alone(&log))?);
    }
    let [stock, ours, owned, plain, our_mcap, convert, zstd] = best;
    let show = |what: &str, seconds: f64| println!("{what:<44} {:>8.2} M events/s", events as f64 * 1e-6 / seconds);
    println!("{events} events of {MESSAGE} bytes, best of {ROUNDS}");
    show("event log, liblcm", stock);
    show("event log, LogReader::read", ours);
    show("event log, LogReader as iterator (copies)", owned);
    show("mcap, the mcap crate's MessageStream", plain);
    show("mcap, LogReader::read, CRCs checked", our_mcap);
    show("event log to mcap", convert);
    show("  zstd alone on the same bytes", zstd);
    println!("event log: {:.1} times the speed of liblcm ({:.1} with copies)", stock / ours, stock / owned);
    println!("mcap: {:.2} times the speed of the mcap crate", plain / our_mcap);
    println!("conversion: zstd needs {:.0} % of the time", 100.0 * zstd / convert);
    Ok(())
}

/// Writes signals with noise in their last bits, like joint measurements.
fn write(path: &Path, events: u64) -> Any<()> {
    let mut log = LogWriter::create(path)?;
    let (mut data, mut noise) = (Vec::new(), 1_u64);
    for i in 0..events {
        data.clear();
        data.extend_from_slice(&0x1234_5678_9abc_def0_u64.to_be_bytes());
        for k in 0.. {
            if data.len() + 8 > MESSAGE {
                break;
            }
            noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let value = (i as f64 * 1e-3 + f64::from(k)).sin() + (noise >> 40) as f64 * 1e-12;
            data.extend_from_slice(&value.to_be_bytes());
        }
        data.resize(MESSAGE, 0);
        let channel = ["ROBOT_STATE", "ROBOT_COMMAND", "CONTROLLER_INPUT", "LEG_STATE"][i as usize % 4];
        log.write(channel, i as i64 * 1_000_000, &data)?;
    }
    log.finish()?;
    Ok(())
}

fn timed(work: impl FnOnce() -> Any<u64>) -> Any<f64> {
    let begin = Instant::now();
    std::hint::black_box(work()?);
    Ok(begin.elapsed().as_secs_f64())
}

fn stock_reads(program: &Path, log: &Path, events: u64) -> Any<f64> {
    let output = Command::new(program).arg(log).output()?;
    let text = String::from_utf8(output.stdout)?;
    let numbers: Vec<u64> = text.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    match numbers[..] {
        [found, _, nanoseconds] if found == events => Ok(nanoseconds as f64 * 1e-9),
        _ => Err(format!("the liblcm reader printed {text:?}, expected {events} events").into()),
    }
}

fn scan(log: &Path) -> Any<u64> {
    let mut reader = LogReader::open(log)?;
    let mut bytes = 0;
    while let Some(item) = reader.read()? {
        if let ItemRef::Event(event) = item {
            bytes += event.data.len() as u64;
        }
    }
    Ok(bytes)
}

fn mcap_crate(log: &Path) -> Any<u64> {
    let file = std::fs::read(log)?;
    let mut bytes = 0;
    for message in mcap::MessageStream::new(&file)? {
        bytes += message?.data.len() as u64;
    }
    Ok(bytes)
}

/// Lower limit of the conversion time: the same bytes through zstd in chunks of the same size.
fn zstd_alone(log: &Path) -> Any<u64> {
    let bytes = std::fs::read(log)?;
    let mut compressor = zstd::bulk::Compressor::new(zstd::DEFAULT_COMPRESSION_LEVEL)?;
    let mut total = 0;
    for chunk in bytes.chunks(1 << 18) {
        total += compressor.compress(chunk)?.len() as u64;
    }
    Ok(total)
}
