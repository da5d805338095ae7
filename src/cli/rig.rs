//! `ramphold rig`: checks a motor and its CAN bus without moving anything.

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use crate::app::{Console, Failure};
use crate::protocol::ValidProtocol;
use crate::rig::can::budget::When;
use crate::rig::can::bus::{self, BitRate, BusSpec};
use crate::rig::can::file::{MotorSettings, ValidRigFile};
use crate::rig::can::scan::scan;
use crate::rig::can::{Connection, DryRun, HandleLimits};

use super::verb::Verb;

/// How long a question of a scan may wait for the adapter; nothing moves, so nothing depends on it.
const SCAN_SEND_TIMEOUT: Duration = Duration::from_millis(50);

/// Check a motor on a CAN bus, or list the nodes of a bus. Nothing moves.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold rig check rig.json --protocol protocols/quick.json\n  \
                        ramphold rig scan socketcan:can0")]
pub struct RigArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Check a rig file, the load of its bus, and the motor itself; with --protocol also whether the protocol can run.
    Check {
        /// The rig file.
        file: PathBuf,
        /// A protocol whose movements are checked against the limits of the rig.
        #[arg(long, value_name = "FILE")]
        protocol: Option<PathBuf>,
        /// Check the files only, and send nothing on the bus.
        #[arg(long)]
        offline: bool,
    },
    /// List the nodes on a bus.
    Scan {
        /// The bus: socketcan:INTERFACE, slcan:DEVICE or socketcand:HOST:PORT:NAME.
        bus: BusSpec,
        /// Bit rate of the bus, bit/s; a serial adapter is set to it.
        #[arg(long, default_value = "1000000", value_parser = bit_rate)]
        bit_rate: BitRate,
    },
}

fn bit_rate(text: &str) -> Result<BitRate, String> {
    text.parse()
        .ok()
        .and_then(BitRate::new)
        .ok_or_else(|| "expected a standard bit rate in bit/s, such as 500000 or 1000000".to_owned())
}

impl Verb for RigArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        match self.what {
            What::Check { file, protocol, offline } => {
                let rig = ValidRigFile::read(&file)?;
                print_budget(&rig, console)?;
                let limits = match protocol {
                    Some(path) => {
                        let protocol = ValidProtocol::read(&path)?;
                        let dry_run = DryRun::of(&protocol, &rig)?;
                        writeln!(
                            console.results(),
                            "{}: every movement stays inside the limits",
                            path.display()
                        )?;
                        *dry_run.limits()
                    }
                    None => HandleLimits::of_rig(&rig.limits),
                };
                if offline { Ok(()) } else { ask_motor(rig, &limits, console) }
            }
            What::Scan { bus, bit_rate } => print_nodes(&bus, bit_rate, console),
        }
    }
}

fn print_budget(rig: &ValidRigFile, console: &Console) -> Result<(), Failure> {
    let mut out = console.results();
    writeln!(out, "{}: {}", rig.file_name(), rig.name)?;
    writeln!(
        out,
        "  {} at {} bit/s, SYNC every {} us, {:.0} samples a second",
        rig.bus,
        rig.bit_rate.bits_per_s(),
        rig.period_us,
        rig.sample_period().rate_hz()
    )?;
    for line in rig.budget().lines() {
        let when = match line.when {
            When::EachPeriod => "each period".to_owned(),
            When::EveryMs(ms) => format!("every {ms} ms"),
        };
        writeln!(out, "    {:40} {} bytes {when}", line.what, line.bytes)?;
    }
    let load = rig.budget().load(rig.period(), rig.bit_rate);
    writeln!(out, "  bus: {} bits a period, load {:.0} %", rig.budget().bits_per_period(), load * 100.0)?;
    if let MotorSettings::Mit(motor) = &rig.motor {
        writeln!(out, "  angle: in steps of {:.3} mrad at the handle", motor.angle_step_rad() * 1e3)?;
    }
    Ok(())
}

fn ask_motor(rig: ValidRigFile, limits: &HandleLimits, console: &Console) -> Result<(), Failure> {
    let mut connection = Connection::open(rig)?;
    connection.check_alone().map_err(Failure::Motor)?;
    let confirmed = connection.prepare(limits);
    let findings = connection.findings().to_vec();
    let released = connection.release();
    let (needed, optional): (Vec<_>, Vec<_>) =
        findings.into_iter().partition(|finding| finding.fault().is_some());
    let mut out = console.results();
    for (title, list) in [
        ("the drive lacks, refuses or contradicts, and is not armed before this is mended:", &needed),
        ("the drive lacks these, and may be armed without them:", &optional),
    ] {
        if !list.is_empty() {
            writeln!(out, "  {title}")?;
            list.iter().try_for_each(|finding| writeln!(out, "    {finding}"))?;
        }
    }
    confirmed.map_err(Failure::Motor)?;
    released.map_err(Failure::Motor)?;
    writeln!(
        out,
        "  motor: identity as expected; limits, watchdogs and frames written and read back; power off"
    )?;
    Ok(())
}

fn print_nodes(spec: &BusSpec, bit_rate: BitRate, console: &Console) -> Result<(), Failure> {
    let gone = |source| Failure::Bus { bus: spec.to_string(), source };
    let mut bus = bus::open(spec, bit_rate, SCAN_SEND_TIMEOUT).map_err(gone)?;
    let nodes = scan(bus.as_mut()).map_err(gone)?;
    let mut out = console.results();
    writeln!(out, "node,state,profile,vendor,product,revision,serial")?;
    let hex = |value: Option<u32>| value.map(|value| format!("0x{value:08X}")).unwrap_or_default();
    for node in &nodes {
        writeln!(
            out,
            "{},{},{},{},{},{},{}",
            node.node,
            node.state.map(|state| state.to_string()).unwrap_or_default(),
            node.profile(),
            hex(node.vendor),
            hex(node.product),
            hex(node.revision),
            hex(node.serial)
        )?;
    }
    if nodes.is_empty() {
        console.message("no node answers; check power, termination and bit rate");
    }
    Ok(())
}
